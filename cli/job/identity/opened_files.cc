// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/opened_files.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/printable.h"
#include "common/scene/gltf/gltf_view.h"

namespace sheaf::cli {
namespace {

namespace fs = std::filesystem;

constexpr size_t kShownBytesMax = 200;  // Limit of a name.

// Without symbolic links; empty if there is no such file.
std::string RealPath(const std::string& path) {
  std::error_code error;
  const fs::path real = fs::canonical(path, error);
  return error ? "" : real.string();
}

}  // namespace

OpenedFiles::OpenedFiles(const std::string& directory, std::shared_ptr<DerivedFiles> derived,
                         std::string main_file)
    : DirectoryFileSource(directory, std::move(derived)),
      real_directory_(RealPath(directory)),
      main_file_(std::move(main_file)) {}

bool OpenedFiles::IsOutside(const std::string& canonical_name, const std::string& path) const {
  if (canonical_name == main_file_ || real_directory_.empty()) return false;
  const fs::path real = RealPath(path), directory = real_directory_;
  return std::mismatch(directory.begin(), directory.end(), real.begin(), real.end()).first !=
         directory.end();
}

absl::StatusOr<std::string> OpenedFiles::LocalPath(const std::string& canonical_name) {
  absl::StatusOr<std::string> path = DirectoryFileSource::LocalPath(canonical_name);
  if (!path.ok()) return path;
  const bool is_outside = IsOutside(canonical_name, *path);
  const MutexLock lock(&states_mutex_);
  if (is_outside && !derived_.contains(canonical_name)) {
    outside_.insert(canonical_name);
    if (IsGltfName(main_file_)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "file \"", Printable(canonical_name, kShownBytesMax),
          "\" leads outside of the scene's folder, which a glTF file may not leave; copy the file "
          "itself into the folder"));
    }
  }
  // Before the reader opens it, so that the contents are at least as new.
  if (const std::optional<FileState> state = StateOfFile(*path)) states_.emplace(*path, *state);
  return path;
}

absl::StatusOr<std::string> OpenedFiles::DerivedPath(const std::string& canonical_name,
                                                     std::string_view bytes) {
  {
    const MutexLock lock(&states_mutex_);
    derived_.insert(canonical_name);
  }
  return DirectoryFileSource::DerivedPath(canonical_name, bytes);
}

void OpenedFiles::Replace(const std::string& canonical_name, const std::string& path) {
  DirectoryFileSource::Replace(canonical_name, path);
  const MutexLock lock(&states_mutex_);
  derived_.insert(canonical_name);
  if (const std::optional<FileState> state = StateOfFile(path)) states_.emplace(path, *state);
}

std::map<std::string, FileState> OpenedFiles::States() const {
  const MutexLock lock(&states_mutex_);
  return states_;
}

std::set<std::string> OpenedFiles::Outside() const {
  const MutexLock lock(&states_mutex_);
  return outside_;
}

std::string OutsideNote(const std::set<std::string>& names) {
  if (names.empty()) return "";
  std::vector<std::string> shown;
  for (const std::string& name : names) {
    if (shown.size() == kOutsideNamesMax) break;
    shown.push_back(Printable(name, kShownBytesMax));
  }
  const size_t hidden = names.size() - shown.size();
  return absl::StrCat(names.size(), names.size() == 1 ? " file" : " files",
                      " outside of the scene's folder ", names.size() == 1 ? "is" : "are",
                      " uploaded: ", absl::StrJoin(shown, ", "),
                      hidden == 0 ? "" : absl::StrCat(" and ", hidden, " more"));
}

absl::Status CheckUnchanged(const std::map<std::string, FileState>& states) {
  for (const auto& [path, state] : states) {
    if (StateOfFile(path) == state) continue;
    return absl::FailedPreconditionError(absl::StrCat(
        path, ": changed while the scene was being read; submit again when it is saved"));
  }
  return absl::OkStatus();
}

absl::Status ChangeOr(const absl::Status& failed, const OpenedFiles& files) {
  absl::Status changed = CheckUnchanged(files.States());
  return changed.ok() ? failed : changed;
}

}  // namespace sheaf::cli
