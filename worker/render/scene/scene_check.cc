// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/scene_check.h"

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "common/base/load_phases.h"
#include "common/base/log_silence.h"
#include "worker/render/medium/medium_velocities.h"
#include "worker/render/plan/render_plan.h"
#include "worker/render/scene/compile_tables.h"

namespace sheaf::render {
namespace {

const std::string* FileOf(const LightDescription& light) {
  return std::visit(
      [](const auto& kind) -> const std::string* {
        if constexpr (requires { kind.file; }) return &kind.file;
        return nullptr;
      },
      light.light);
}

bool IsLarge(const std::string& file, FileSource& files) {
  if (file.empty()) return false;
  const absl::StatusOr<std::string> path = files.LocalPath(file);
  if (!path.ok()) return false;  // Reading it says so.
  std::error_code error;
  const uint64_t bytes = std::filesystem::file_size(*path, error);
  return !error && bytes > kCheckedImageBytesMax;
}

void LeaveOutFiles(SceneDescription* scene, FileSource& files) {
  std::erase_if(scene->lights, [&](const LightDescription& light) {
    const std::string* file = FileOf(light);
    return file != nullptr && IsLarge(*file, files);
  });
  for (AreaLightDescription& light : scene->area_lights) {
    if (IsLarge(light.file, files)) light.file.clear();
  }
  for (MediumDescription& medium : scene->media) {
    if (std::holds_alternative<VolumeFileMedium>(medium.kind)) medium.kind = HomogeneousMedium{};
  }
}

}  // namespace

absl::Status CheckScene(SceneDescription scene, const FrameSettings& settings, FileSource& files) {
  const PhaseTimer timer(LoadPhase::kCheck, PhaseCpu::kThread, PhaseExtent::kWhole);
  const LogSilence silence;
  LeaveOutFiles(&scene, files);
  CompileInput input;
  input.techniques.bound_media_once = true;
  absl::StatusOr<MediumVelocities> velocities = ReadMediumVelocities(files, input.threads, &scene);
  if (!velocities.ok()) return velocities.status();
  input.velocities = *std::move(velocities);
  input.plan = MakeRenderPlan(scene, settings);
  return CompileTables(std::move(scene), settings, files, std::move(input)).status();
}

}  // namespace sheaf::render
