// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CompileTables: all of a CompiledScene but the ray tracer, of a scene whose meshes are displaced
// already or stay as they are. CompileScene and CheckScene share it.
#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/medium/medium_velocities.h"
#include "worker/render/scene/compile_scene.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

// Facts about the scene before its meshes are displaced.
struct CompileInput {
  RenderPlan plan;
  MediumVelocities velocities;
  int threads = 1;
  uint64_t texture_cache_bytes_max = 0;  // As for TextureCache.
  CompileTechniques techniques;
  uint64_t volume_memory_bytes_max = CompileLimits().volume_memory_bytes_max;
};

// Errors: those of CompileScene.
absl::StatusOr<std::unique_ptr<CompiledScene>> CompileTables(SceneDescription description,
                                                             const FrameSettings& settings,
                                                             FileSource& files, CompileInput input);

// Builds what light paths and guiding need, if the frame has any. Requires: the tables of lights
// and media are complete. Errors: kInvalidArgument for light paths beside similarity.
absl::Status BuildTechniques(CompiledScene* scene);

}  // namespace sheaf::render
