// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/opened_scene.h"

#include <cstdio>
#include <filesystem>
#include <utility>

#include "common/base/status.h"

namespace sheaf::cli {

absl::StatusOr<SceneFile> ReadSceneFile(const std::string& path) {
  const std::filesystem::path scene(path);
  const std::string directory = scene.parent_path().string();
  auto files = std::make_unique<DirectoryFileSource>(directory.empty() ? "." : directory);
  absl::StatusOr<ReadSceneResult> read = ReadScene(scene.filename().string(), *files);
  if (!read.ok()) return read.status();
  return SceneFile{std::move(files), *std::move(read)};
}

ExitCode OpenScene(const JobArguments& arguments, OpenedScene* opened) {
  absl::StatusOr<SceneFile> file = ReadSceneFile(arguments.scene);
  if (!file.ok()) return ReportSceneError(file.status());
  for (const SceneDiagnostic& diagnostic : file->read.diagnostics) {
    std::fprintf(stderr, "%s\n", diagnostic.text.c_str());
  }
  const absl::StatusOr<FrameSettings> settings =
      ResolveSettings(file->read.scene, arguments.settings);
  if (!settings.ok()) {
    return ReportError(ExitCode::kUsage, Annotate(settings.status(), arguments.scene));
  }
  *opened = {*std::move(file), *settings};
  return ExitCode::kOk;
}

}  // namespace sheaf::cli
