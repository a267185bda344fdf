// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CompileScene: SceneDescription + FrameSettings > CompiledScene, which the integrator renders.
#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/medium/equiangular_mode.h"
#include "worker/render/plan/path_limits.h"
#include "worker/render/plan/render_plan.h"

namespace sheaf::render {

struct CompileLimits {
  uint64_t texture_cache_bytes_max = uint64_t{512} << 20;
  uint64_t volume_memory_bytes_max = uint64_t{512} << 20;  // For pages of volumes.
  uint32_t build_threads = 0;                              // 0: the machine's number of threads.
  // Total over all displaced meshes; a triangle takes some 150 bytes during construction, 60 after.
  uint64_t displaced_triangles_max = uint64_t{1} << 24;
};

// Choices that change the noise of an image but not its expectation; tests compare the techniques
// with each other.
struct CompileTechniques {
  bool choose_lights_evenly = false;  // Instead of by their contribution to a point.
  bool merge_media = true;            // MediumTable::MergeOverlapping.
  bool bound_media_once = false;      // A single bound per medium instead of local ones.
  EquiangularMode equiangular_mode = EquiangularMode::kWhereEfficient;
  // Roulette may end paths on surfaces after more than this number of scattering events.
  uint32_t roulette_depth_min = kRouletteDepthMin;
  // Paths of the first iteration of a guided frame's training; 0: by the size of the frame.
  uint64_t training_paths_first = 0;
  // Factor of density bounds. Below 1 they are wrong, which rendering must detect.
  float majorant_factor = 1;
};

// Thread safety: a constant one may be used from many threads at once.
class CompiledScene;
struct CompiledSceneDeleter {
  void operator()(const CompiledScene* scene) const;
};
using CompiledScenePtr = std::unique_ptr<const CompiledScene, CompiledSceneDeleter>;
// A scene of one user, who may change its techniques.
using ChangeableScenePtr = std::unique_ptr<CompiledScene, CompiledSceneDeleter>;

// SceneDescription + RenderPlan > CompiledScene. Takes the description by value: its mesh buffers
// move to the ray tracer without a copy.
// Errors: kInvalidArgument with the location in the scene file; kResourceExhausted over a limit.
absl::StatusOr<CompiledScenePtr> CompileScene(SceneDescription scene, const FrameSettings& settings,
                                              FileSource& files, const CompileLimits& limits = {},
                                              const CompileTechniques& techniques = {});
// The same, for SetTechniques.
absl::StatusOr<ChangeableScenePtr> CompileChangeableScene(SceneDescription scene,
                                                          const FrameSettings& settings,
                                                          FileSource& files,
                                                          const CompileLimits& limits = {},
                                                          const CompileTechniques& techniques = {});
// Lets the scene be rendered by other techniques, without compiling it again; a guided one is
// untrained afterwards. Requires: the scene was compiled for camera paths, and no other thread uses
// it. The plan's `traits` follow, its texts do not. Errors: kInvalidArgument for light paths beside
// similarity.
absl::Status SetTechniques(TechniqueSet techniques, CompiledScene* scene);
const RenderPlan& PlanOf(const CompiledScene& scene);
const FrameSettings& SettingsOf(const CompiledScene& scene);
uint64_t MemoryBytesOf(const CompiledScene& scene);

}  // namespace sheaf::render
