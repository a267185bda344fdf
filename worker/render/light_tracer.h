// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTracer: traces light passes into a sink.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "common/film/tile_geometry.h"
#include "worker/render/integrator/ray_counts.h"
#include "worker/render/integrator/splat_sink.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

// Thread safety: none. The scene must outlive it. Memory: where the scene merges, that of a
// GatherMap of the window's pixels.
class LightTracer {
 public:
  // Requires: the scene has light paths. Camera paths of the window's pixels are merged with.
  LightTracer(const CompiledScene& scene, const PixelRect& window);
  ~LightTracer();
  LightTracer(const LightTracer&) = delete;
  LightTracer& operator=(const LightTracer&) = delete;

  // Traces one light path for each pixel of the frame: a pure function of (scene, window, pass).
  // Calls goes_on once a row, and stops where that is false; then returns false.
  bool TracePass(uint64_t pass, const std::function<bool()>& goes_on, SplatSink* splats,
                 RayCounts* counts);
  // How many camera paths of the pass light paths are merged with.
  size_t CountGathered(uint64_t pass, RayCounts* counts);

 private:
  bool Gather(uint64_t pass, const std::function<bool()>& goes_on, RayCounts* counts);

  const CompiledScene& scene_;
  const PixelRect window_;
  const size_t variant_;
  std::unique_ptr<GatherMap> map_;  // Null where the scene does not merge.
};

}  // namespace sheaf::render
