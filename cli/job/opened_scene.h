// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A scene file on this machine, with the folder that its relative file names refer to.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "cli/exit_code.h"
#include "cli/gltf/gltf_inputs.h"
#include "cli/job/identity/opened_files.h"
#include "cli/job/prepared_job.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "worker/render/ablation/technique_measurement.h"

namespace sheaf::cli {

struct SceneFile {
  std::unique_ptr<OpenedFiles> files;
  ReadSceneResult read;
};
// With the film of gltf->size(). Also warns if the scene's image is necessarily black. gltf
// outlives the call; its derived files are kept by the result. Errors: those of ReadSceneByName and
// GltfInputs::Add.
absl::StatusOr<SceneFile> ReadSceneFile(const std::string& path, GltfInputs* gltf,
                                        int32_t frame_number = 1);

// A line that says so where the user's crop reaches beyond the image; else empty.
std::string CropNote(const RenderSettings& settings, const FrameSettings& resolved);

// As ResolveSettings of the scene; cameras of the file may be those of two eyes.
absl::StatusOr<FrameSettings> ResolveSettings(const ReadSceneResult& read, RenderSettings settings);

struct OpenedScene {
  SceneFile file;
  FrameSettings settings;
};
// For commands that render in this process: reads arguments.scene, prints its diagnostics and
// resolves its settings. Returns the code of a failure, which is also printed, or kOk.
ExitCode OpenScene(const JobArguments& arguments, OpenedScene* opened);

// If `effort` is given, sets the techniques of *resolved to the best ones measured on small images.
// Returns a line that says so; empty where nothing was measured, or unasked and camera paths are
// best. Unasked, frames that MayMeasureUnasked excludes keep theirs, and so do scenes that
// cannot be compiled, which another check tells. Errors: as MeasureTechniques, where asked.
// Where asked, and may_share, paths that count in several pixels are a choice, for frames that may
// have them; the eyes of a stereo frame have no other.
absl::StatusOr<std::string> ChooseTechniques(std::optional<render::TechniqueEffort> effort,
                                             bool may_share, const SceneDescription& scene,
                                             FileSource& files, FrameSettings* resolved);

}  // namespace sheaf::cli
