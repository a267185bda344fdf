// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OpenedFiles: the files of a scene on this machine, as they were when a reader first asked for
// them. A scene that is saved meanwhile would otherwise be a mixture: its settings of one version,
// its contents of another.
#pragma once

#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/content/file_state.h"
#include "common/scene/file_source.h"

namespace sheaf::cli {

class OpenedFiles final : public DirectoryFileSource {
 public:
  using DirectoryFileSource::DirectoryFileSource;
  absl::StatusOr<std::string> LocalPath(const std::string& canonical_name) override;

  // By path.
  std::map<std::string, FileState> States() const;

 private:
  mutable Mutex states_mutex_;
  std::map<std::string, FileState> states_ ABSL_GUARDED_BY(states_mutex_);
};

// Errors: kFailedPrecondition if a file is not as it was, naming it.
absl::Status CheckUnchanged(const std::map<std::string, FileState>& states);

}  // namespace sheaf::cli
