// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The compiled variants of the integrator for stereo frames, and what they give to the film.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/film/film_tile.h"
#include "worker/render/camera/eye_camera.h"
#include "worker/render/integrator/ray_counts.h"

namespace sheaf::render {

class CompiledScene;

// The contributions of one path of an eye to both eyes. Radiances include their shares, the other
// members of samples do not.
struct EyeSample {
  FilmSample own;       // The sample of the path's own pixel.
  float own_share = 1;  // The part of a sample of the pixel that it stands for.
  bool is_shifted = false;
  // The same in the other eye, per pixel of its film, around a point of it.
  Vec2d film;
  FilmSample other;
  float other_share = 0;
};

class EyeSink {
 public:
  virtual ~EyeSink() = default;
  // x, y: the path's pixel of the eye's own film. Called once for each, for one eye after the
  // other.
  virtual void Add(Eye eye, int32_t x, int32_t y, const EyeSample& sample) = 0;
};

// Traces sample `pass` of each pixel of row y of the eye. Requires: scene.eyes.
using EyeRowFunction = void (*)(const CompiledScene& scene, Eye eye, int32_t y, uint64_t pass,
                                EyeSink* sink, RayCounts* counts);
// variant: an index in AllEyeVariants().
EyeRowFunction EyeRowFunctionOf(size_t variant);

// Defined once for each variant, in generated files.
template <uint32_t kTraits>
void TraceEyeRow(const CompiledScene& scene, Eye eye, int32_t y, uint64_t pass, EyeSink* sink,
                 RayCounts* counts);

}  // namespace sheaf::render
