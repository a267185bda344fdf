// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CompileScene: SceneDescription + FrameSettings > CompiledScene, which the integrator renders.
#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/medium/line_choice.h"
#include "worker/render/plan/path_limits.h"
#include "worker/render/plan/render_plan.h"

namespace sheaf::render {

struct CompileLimits {
  uint64_t texture_cache_bytes_max = uint64_t{512} << 20;
  uint32_t build_threads = 0;  // 0: as many as the machine has.
  // Of all displaced meshes together; each takes some 150 bytes while it is made, 60 afterwards.
  uint64_t displaced_triangles_max = uint64_t{1} << 24;
};

// Choices that change the noise of a picture and not its expectation; tests compare the techniques
// with each other.
struct CompileTechniques {
  bool choose_lights_evenly = false;  // Instead of by what each may send to a point.
  bool bound_media_once = false;      // One bound for all of a medium, not one where it is dense.
  LinesInVarying lines_in_varying = LinesInVarying::kWhereItPays;
  // Roulette may end paths on surfaces after more than so many scatterings.
  uint32_t roulette_depth_min = kRouletteDepthMin;
  // What bounds of densities are multiplied by. Below 1 they are wrong, which rendering must find.
  float majorant_factor = 1;
};

// Immutable after CompileScene; all const members may be used from many threads at once.
class CompiledScene;
struct CompiledSceneDeleter {
  void operator()(const CompiledScene* scene) const;
};
using CompiledScenePtr = std::unique_ptr<const CompiledScene, CompiledSceneDeleter>;

// SceneDescription + RenderPlan > CompiledScene. Takes the description by value: its mesh buffers
// are handed to the ray tracer without a copy.
// Errors: kInvalidArgument with the location in the scene file; kResourceExhausted over a limit.
absl::StatusOr<CompiledScenePtr> CompileScene(SceneDescription scene, const FrameSettings& settings,
                                              FileSource& files, const CompileLimits& limits = {},
                                              const CompileTechniques& techniques = {});
const RenderPlan& PlanOf(const CompiledScene& scene);
const FrameSettings& SettingsOf(const CompiledScene& scene);
uint64_t MemoryBytesOf(const CompiledScene& scene);

}  // namespace sheaf::render
