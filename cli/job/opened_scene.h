// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A scene file of this machine, with the folder that it names its other files from.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "cli/exit_code.h"
#include "cli/job/prepared_job.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"

namespace sheaf::cli {

struct SceneFile {
  std::unique_ptr<DirectoryFileSource> files;
  ReadSceneResult read;
};
// Also warns of a scene whose picture must be black. Errors: those of ReadScene.
absl::StatusOr<SceneFile> ReadSceneFile(const std::string& path);

struct OpenedScene {
  SceneFile file;
  FrameSettings settings;
};
// For commands that render on their own: reads arguments.scene, prints its diagnostics and resolves
// its settings. Not kOk where that failed, which is printed too.
ExitCode OpenScene(const JobArguments& arguments, OpenedScene* opened);

}  // namespace sheaf::cli
