// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OpenedFiles: the files of a scene on this machine, in the state of a reader's first access.
// Otherwise a scene that is saved meanwhile would be a mixture of two versions.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/content/file_state.h"
#include "common/scene/file_source.h"

namespace sheaf::cli {

class OpenedFiles final : public DirectoryFileSource {
 public:
  // main_file: its name in the directory. The user has chosen it, so it may be any symbolic link;
  // files that a glTF file names must be inside the directory.
  explicit OpenedFiles(const std::string& directory,
                       std::shared_ptr<DerivedFiles> derived = nullptr, std::string main_file = "");
  // Errors: also kInvalidArgument for a file outside of a glTF file's directory.
  absl::StatusOr<std::string> LocalPath(const std::string& canonical_name) override;
  absl::StatusOr<std::string> DerivedPath(const std::string& canonical_name,
                                          std::string_view bytes) override;
  // As that of DirectoryFileSource.
  void Replace(const std::string& canonical_name, const std::string& path);

  // By path.
  std::map<std::string, FileState> States() const;
  // Names of the files outside of the directory, by their names or by symbolic links.
  std::set<std::string> Outside() const;

 private:
  bool IsOutside(const std::string& canonical_name, const std::string& path) const;

  const std::string real_directory_;  // Empty: unknown.
  const std::string main_file_;
  mutable Mutex states_mutex_;
  std::map<std::string, FileState> states_ ABSL_GUARDED_BY(states_mutex_);
  std::set<std::string> derived_ ABSL_GUARDED_BY(states_mutex_);
  std::set<std::string> outside_ ABSL_GUARDED_BY(states_mutex_);
};

// Says which files outside of a scene's folder are uploaded, naming the first few.
// Empty if there are none.
inline constexpr size_t kOutsideNamesMax = 5;
std::string OutsideNote(const std::set<std::string>& names);

// Errors: kFailedPrecondition if a file has changed, naming it.
absl::Status CheckUnchanged(const std::map<std::string, FileState>& states);
// Why a scene could not be read: a changed file, if there is one, because the contents are then a
// mixture. failed: the reader's error.
absl::Status ChangeOr(const absl::Status& failed, const OpenedFiles& files);

}  // namespace sheaf::cli
