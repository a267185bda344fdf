// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// StudyScenes: compiles the scenes of a study. Each setting with light paths has two: the frame,
// for tiles, and the frame made smaller, for light passes.
//
// Where paths from the camera are guided, the weights of light paths depend on the guiding field.
// So the two scenes of a setting, and the reference, share one: that of the settings as given. It
// is learned once.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/tile_pass.h"

namespace sheaf::cli {

struct StudyScene {
  render::CompiledScenePtr frame;
  render::CompiledScenePtr small;   // Null: light passes use the frame itself, or there are none.
  double training_cpu_seconds = 0;  // Cost of the guiding field; 0 if there is none.

  // The scene whose frame light passes are of; null if the setting has no light paths.
  const render::CompiledScene* light() const {
    if (!HasLightPaths(SettingsOf(*frame).techniques)) return nullptr;
    return small != nullptr ? small.get() : frame.get();
  }
};

// Not thread-safe. The scene and the files must outlive it.
class StudyScenes {
 public:
  StudyScenes(const SceneDescription& scene, FileSource& files, int threads)
      : scene_(scene), files_(files), threads_(threads) {}

  // Guided settings are trained; those with light paths are guided by what the first one learned.
  // shrink: how many times smaller the frame of light passes is; ignored without light paths.
  // Errors: as CompileScene and TrainGuiding.
  absl::StatusOr<StudyScene> Compile(const FrameSettings& settings, int32_t shrink,
                                     const render::CompileTechniques& techniques = {});
  // Remakes the smaller frame of a compiled setting; a no-op without light paths.
  absl::Status CompileSmall(int32_t shrink, const render::CompileTechniques& techniques,
                            StudyScene* scene);

 private:
  absl::StatusOr<render::CompiledScenePtr> CompileOne(const FrameSettings& settings,
                                                      const render::CompileTechniques& techniques);
  // Learns the field of a scene and gives it; returns the CPU seconds.
  absl::StatusOr<double> Train(const render::CompiledScene& scene, std::string* field);

  const SceneDescription& scene_;
  FileSource& files_;
  const int threads_;
  std::string field_;  // For settings with light paths, once one is guided.
  double field_cpu_seconds_ = 0;
};

}  // namespace sheaf::cli
