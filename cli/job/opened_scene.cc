// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/opened_scene.h"

#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "cli/job/foreign_scene.h"
#include "cli/message.h"
#include "cli/usd/usd_scene.h"
#include "common/base/load_phases.h"
#include "common/base/memory_room.h"
#include "common/base/status.h"
#include "common/scene/black_image.h"
#include "common/scene/film_size.h"
#include "common/scene/reader/scene_file_reader.h"
#include "common/scene/settings/ray_visibility_check.h"
#include "coordinator/core/job/job_check.h"
#include "worker/render/ablation/sharing_measurement.h"
#include "worker/render/ablation/technique_measurement.h"
#include "worker/render/scene/memory_estimate.h"

namespace sheaf::cli {

absl::StatusOr<SceneFile> ReadSceneFile(const std::string& path, GltfInputs* gltf,
                                        int32_t frame_number) {
  if (absl::Status status = CheckSceneFormatOf(path); !status.ok()) return status;
  const std::filesystem::path scene(path);
  const std::string directory = scene.parent_path().string();
  const std::string main_file = NameAsRead(scene.filename().string());
  auto files = std::make_unique<OpenedFiles>(directory.empty() ? "." : directory, gltf->derived(),
                                             main_file);
  std::vector<std::string> usd_notes;
  if (IsUsdName(path)) {
    absl::StatusOr<std::vector<std::string>> notes = gltf->AddUsd(path, main_file, files.get());
    if (!notes.ok()) return notes.status();
    usd_notes = *std::move(notes);
  }
  if (absl::Status status = gltf->Add(main_file, frame_number, files.get()); !status.ok()) {
    return status;
  }
  SceneReaderLimits limits;
  if (const MemoryRoom room = FindMemoryRoom(); room.bytes < limits.memory_bytes_max) {
    limits.memory_bytes_max = room.bytes;
    limits.memory_limit = "the remainder of " + room.limit;
  }
  absl::StatusOr<ReadSceneResult> read = ReadSceneByName(main_file, *files, limits);
  if (!read.ok()) return ChangeOr(read.status(), *files);
  for (const std::string& note : usd_notes) {
    read->diagnostics.push_back(
        {SceneDiagnostic::Severity::kNote, absl::StrCat(path, ": note: ", note)});
  }
  ResizeFilm(gltf->size(), &read->scene);
  if (std::string black =
          WhyBlack(read->scene, IsGltfName(main_file) ? SceneFormat::kGltf : SceneFormat::kPbrt);
      !black.empty()) {
    read->diagnostics.push_back({SceneDiagnostic::Severity::kWarning, std::move(black)});
  }
  return SceneFile{std::move(files), *std::move(read)};
}

absl::StatusOr<FrameSettings> ResolveSettings(const ReadSceneResult& read,
                                              RenderSettings settings) {
  if (read.eye_distance > 0) settings.eye_distance = read.eye_distance;
  return ResolveSettings(read.scene, settings);
}

ExitCode OpenScene(const JobArguments& arguments, OpenedScene* opened) {
  GltfInputs gltf(arguments.gltf, arguments.size);
  absl::StatusOr<SceneFile> file = ReadSceneFile(arguments.scene, &gltf);
  if (!file.ok()) return ReportSceneError(file.status());
  for (const SceneDiagnostic& diagnostic : file->read.diagnostics) {
    PrintSceneNote(diagnostic.text);
  }
  const absl::StatusOr<FrameSettings> settings = ResolveSettings(file->read, arguments.settings);
  if (!settings.ok()) {
    return ReportError(ExitCode::kUsage, Annotate(settings.status(), arguments.scene));
  }
  if (const std::string note = CropNote(arguments.settings, *settings); !note.empty()) {
    PrintNote(absl::StrCat(arguments.scene, ": ", note));
  }
  *opened = {*std::move(file), *settings};
  return ExitCode::kOk;
}

std::string CropNote(const RenderSettings& settings, const FrameSettings& resolved) {
  const PixelRect& window = resolved.window;
  if (!settings.crop || resolved.IsStereo() || window == *settings.crop) return "";
  return absl::StrCat("--crop reaches beyond the image; rendered are the pixels ", window.x0, ",",
                      window.y0, ",", window.x1, ",", window.y1);
}

namespace {

// Whether a farm takes a frame of this size in one tile.
bool FitsSharing(FrameSettings settings) {
  settings.techniques = TechniqueSet{Technique::kSharing};
  return coordinator::LightPassesMax(settings, coordinator::Limits()) > 0;
}

// For a stereo frame, whose eyes share paths from the camera alone.
absl::StatusOr<std::string> ChooseSharing(const SceneDescription& scene, FileSource& files,
                                          FrameSettings* resolved) {
  resolved->techniques = TechniqueSet::kCamera;
  const absl::StatusOr<render::SharingMeasurement> measured =
      render::MeasureSharing(scene, *resolved, files);
  if (!measured.ok()) return measured.status();
  resolved->techniques = measured->Best();
  return absl::StrCat("techniques: ", resolved->techniques.Name(), "; ",
                      render::FormatSharingMeasurement(*measured));
}

}  // namespace

absl::StatusOr<std::string> ChooseTechniques(std::optional<render::TechniqueEffort> effort,
                                             bool may_share, const SceneDescription& scene,
                                             FileSource& files, FrameSettings* resolved) {
  if (!effort) return std::string();
  if (FirstInvisible(scene) != nullptr) {
    if (*effort != render::TechniqueEffort::kAsked) return std::string();
    resolved->techniques = TechniqueSet::kCamera;
    return std::string("techniques: camera, as some rays do not see all of the scene");
  }
  const bool asked = *effort == render::TechniqueEffort::kAsked;
  if (!asked &&
      !render::MayMeasureUnasked(*resolved, render::EstimateMemory(scene, files).TotalBytes())) {
    return std::string();
  }
  const PhaseTimer timer(LoadPhase::kTechniques, PhaseCpu::kProcess, PhaseExtent::kWhole);
  if (resolved->IsStereo()) return ChooseSharing(scene, files, resolved);
  const absl::StatusOr<render::TechniqueMeasurement> measured =
      render::MeasureTechniques(scene, *resolved, files, *effort);
  if (!measured.ok()) return asked ? measured.status() : absl::StatusOr<std::string>("");
  resolved->techniques = measured->Best();
  if (!asked && resolved->techniques == TechniqueSet::kCamera) return std::string();
  std::string line = render::FormatTechniqueMeasurement(*measured);
  if (asked && may_share && render::MayShare(*resolved) && FitsSharing(*resolved)) {
    const absl::StatusOr<render::SharingMeasurement> sharing =
        render::MeasureSharing(scene, *resolved, files);
    if (!sharing.ok()) return sharing.status();
    // It has no other techniques beside it.
    const TechniqueSet best = resolved->techniques;
    const double others =
        best == TechniqueSet::kCamera
            ? 1
            : render::kCombinationGainMin * measured->Gain(best.Without(Technique::kSplitting));
    if (sharing->Gain() > others) resolved->techniques = sharing->Best();
    absl::StrAppend(&line, "; chosen: ", resolved->techniques.Name(), ", as ",
                    render::FormatSharingMeasurement(*sharing));
  }
  if (!asked) absl::StrAppend(&line, "; --techniques camera keeps paths from the camera alone");
  return line;
}

}  // namespace sheaf::cli
