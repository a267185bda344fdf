// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/opened_files.h"

#include <optional>

#include "absl/strings/str_cat.h"

namespace sheaf::cli {

absl::StatusOr<std::string> OpenedFiles::LocalPath(const std::string& canonical_name) {
  absl::StatusOr<std::string> path = DirectoryFileSource::LocalPath(canonical_name);
  if (!path.ok()) return path;
  // Before the reader opens it, so that what it reads is at least as new.
  if (const std::optional<FileState> state = StateOfFile(*path)) {
    const MutexLock lock(&states_mutex_);
    states_.emplace(*path, *state);
  }
  return path;
}

std::map<std::string, FileState> OpenedFiles::States() const {
  const MutexLock lock(&states_mutex_);
  return states_;
}

absl::Status CheckUnchanged(const std::map<std::string, FileState>& states) {
  for (const auto& [path, state] : states) {
    if (StateOfFile(path) == state) continue;
    return absl::FailedPreconditionError(absl::StrCat(
        path, ": changed while the scene was being read; submit again when it is saved"));
  }
  return absl::OkStatus();
}

}  // namespace sheaf::cli
