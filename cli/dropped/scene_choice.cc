// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/dropped/scene_choice.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "cli/job/foreign_scene.h"
#include "common/base/status.h"
#include "common/content/relative_name.h"
#include "common/scene/reader/scene_file_reader.h"

namespace sheaf::cli {
namespace {

namespace fs = std::filesystem;

struct FolderEntries {
  std::vector<fs::path> files, folders;
};

// Symbolic links are neither.
absl::StatusOr<FolderEntries> List(const fs::path& folder) {
  FolderEntries entries;
  std::error_code error;
  for (fs::directory_iterator it(folder, error); !error && it != fs::directory_iterator();
       it.increment(error)) {
    const fs::file_status status = it->symlink_status(error);
    if (error) break;
    if (fs::is_directory(status)) entries.folders.push_back(it->path());
    if (fs::is_regular_file(status)) entries.files.push_back(it->path());
  }
  if (error) return StatusFromErrno(error.value(), absl::StrCat("listing ", folder.string()));
  return entries;
}

// A folder that was dropped, or packed, as a whole.
absl::StatusOr<fs::path> TopOf(const std::string& folder) {
  fs::path top = folder;
  for (size_t depth = 0; depth < kRelativeNamePartsMax; ++depth) {
    const absl::StatusOr<FolderEntries> entries = List(top);
    if (!entries.ok()) return entries.status();
    if (!entries->files.empty() || entries->folders.size() != 1) break;
    top = entries->folders.front();
  }
  return top;
}

// Names of the scenes in the folder, and in those below it if `below`.
absl::StatusOr<std::vector<std::string>> ScenesIn(const fs::path& top, bool below) {
  std::vector<std::string> scenes;
  std::vector<fs::path> waiting = {top};
  while (!waiting.empty() && scenes.size() < kScenesListedMax) {
    const fs::path folder = waiting.back();
    waiting.pop_back();
    const absl::StatusOr<FolderEntries> entries = List(folder);
    if (!entries.ok()) return entries.status();
    for (const fs::path& file : entries->files) {
      if (HasSceneEnding(file.string())) scenes.push_back(file.lexically_relative(top).string());
    }
    if (below) waiting.insert(waiting.end(), entries->folders.begin(), entries->folders.end());
  }
  std::sort(scenes.begin(), scenes.end());
  if (scenes.size() > kScenesListedMax) scenes.resize(kScenesListedMax);
  return scenes;
}

absl::Status NoSceneError(const fs::path& top) {
  const absl::StatusOr<FolderEntries> entries = List(top);
  if (entries.ok() && entries->files.size() == 1) {
    absl::Status foreign = CheckSceneFormatOf(entries->files.front().string());
    if (!foreign.ok()) return foreign;
  }
  return absl::InvalidArgumentError(
      absl::StrCat("no scene is among the dropped files: drop a ", SceneEndings(),
                   " file with the files that it names, their folder, or a zip file of it"));
}

}  // namespace

absl::StatusOr<SceneChoice> FindScene(const std::string& folder, const std::string& wanted) {
  const absl::StatusOr<fs::path> top = TopOf(folder);
  if (!top.ok()) return top.status();
  if (!wanted.empty()) {
    if (absl::Status status = CheckRelativeName(wanted); !status.ok()) return status;
    const fs::path path = *top / wanted;
    std::error_code error;
    if (fs::is_regular_file(fs::symlink_status(path, error))) return SceneChoice{path.string(), {}};
    return absl::InvalidArgumentError(
        absl::StrCat("the scene ", wanted, " is not among the dropped files"));
  }
  for (const bool below : {false, true}) {
    absl::StatusOr<std::vector<std::string>> scenes = ScenesIn(*top, below);
    if (!scenes.ok()) return scenes.status();
    if (scenes->size() == 1) return SceneChoice{(*top / scenes->front()).string(), {}};
    if (!scenes->empty()) return SceneChoice{"", *std::move(scenes)};
  }
  return NoSceneError(*top);
}

}  // namespace sheaf::cli
