// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_scenes.h"

#include <utility>

#include "cli/quote/shrunk_frame.h"
#include "worker/render/guiding_training.h"

namespace sheaf::cli {

absl::StatusOr<StudyScene> StudyScenes::Compile(const FrameSettings& settings, int32_t shrink,
                                                const render::CompileTechniques& techniques) {
  StudyScene made;
  absl::StatusOr<render::CompiledScenePtr> frame = CompileOne(settings, techniques);
  if (!frame.ok()) return frame.status();
  made.frame = *std::move(frame);
  const bool shares_field = HasLightPaths(settings.techniques);
  if (NeedsTraining(settings.techniques)) {
    if (shares_field && !field_.empty()) {
      if (absl::Status set = SetGuiding(*made.frame, field_); !set.ok()) return set;
      made.training_cpu_seconds = field_cpu_seconds_;
    } else {
      std::string field;
      const absl::StatusOr<double> seconds = Train(*made.frame, &field);
      if (!seconds.ok()) return seconds.status();
      made.training_cpu_seconds = *seconds;
      if (shares_field) {
        field_ = std::move(field);
        field_cpu_seconds_ = *seconds;
      }
    }
  }
  if (absl::Status status = CompileSmall(shrink, techniques, &made); !status.ok()) return status;
  return made;
}

absl::Status StudyScenes::CompileSmall(int32_t shrink, const render::CompileTechniques& techniques,
                                       StudyScene* scene) {
  scene->small = nullptr;
  const FrameSettings& settings = SettingsOf(*scene->frame);
  if (!HasLightPaths(settings.techniques) || shrink <= 1) return absl::OkStatus();
  absl::StatusOr<render::CompiledScenePtr> small =
      CompileOne(ShrunkFrame(settings, shrink), techniques);
  if (!small.ok()) return small.status();
  scene->small = *std::move(small);
  return NeedsTraining(settings.techniques) ? SetGuiding(*scene->small, field_) : absl::OkStatus();
}

absl::StatusOr<render::CompiledScenePtr> StudyScenes::CompileOne(
    const FrameSettings& settings, const render::CompileTechniques& techniques) {
  return render::CompileScene(scene_, settings, files_,
                              {.build_threads = static_cast<uint32_t>(threads_)}, techniques);
}

absl::StatusOr<double> StudyScenes::Train(const render::CompiledScene& scene, std::string* field) {
  render::RenderStats stats;
  absl::StatusOr<std::string> learned =
      render::TrainGuiding(scene, static_cast<uint32_t>(threads_), {}, &stats);
  if (!learned.ok()) return learned.status();
  *field = *std::move(learned);
  if (absl::Status set = SetGuiding(scene, *field); !set.ok()) return set;
  return stats.cpu_seconds;
}

}  // namespace sheaf::cli
