// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EnterPrivateRoot: replaces the file system that this process sees by an empty one, into which
// chosen files and folders are mounted for reading.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"

namespace sheaf::worker {

// A file that appears under another path.
struct MountedFile {
  std::string source;  // Absolute, without symbolic links.
  std::string target;  // Absolute.
};

// Mounts the files at their targets, and the paths where they are; there are no devices, no /proc,
// and nothing can be written but in `writable`, a folder that is mounted where it is (empty: none).
// Symbolic links among the paths stay links.
// Requires: a mount namespace of its own, with the privilege to mount.
// Errors: kUnavailable and similar, with the step that failed; the file system is then undefined.
absl::Status EnterPrivateRoot(const std::vector<MountedFile>& files,
                              const std::vector<std::string>& paths,
                              const std::string& writable = "");

}  // namespace sheaf::worker
