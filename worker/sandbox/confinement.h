// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Confine: takes from this process everything that rendering one scene does not need.
#pragma once

#include <signal.h>

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "worker/sandbox/private_root.h"
#include "worker/sandbox/protections.h"

namespace sheaf::worker {

struct Confinement {
  Protections protections;
  // The scene's files. Without namespaces, a file's target is its source.
  std::vector<MountedFile> files;
  // A folder in which files may be made, absolute and without symbolic links; empty: none. Each
  // file has at most `file_bytes_max` bytes: writing more fails, and raises SIGXFSZ.
  std::string writable_folder;
  uint64_t file_bytes_max = 0;
  // Limit of writable memory (RLIMIT_DATA): allocations beyond it fail.
  uint64_t memory_bytes_max = 0;
};

// Files of a scene with namespaces: each is a mount, of which systems allow 100,000 by default.
inline constexpr size_t kMountedFilesMax = 65'536;
inline constexpr uint64_t kConfinedOpenFilesMax = 1'024;
// Threads and processes, where a user namespace counts them apart from the user's others.
inline constexpr uint64_t kConfinedThreadsMax = 16'384;

// Ends a process that waits for the one in namespaces, and that one before it, so that it is
// reaped.
inline constexpr int kStopSupervised = SIGUSR1;

// The process ends when its parent does. Call again after every fork.
void EndWithParent();

// Applies the protections, gives up all privileges, and sets the limits above; no core file and,
// without a writable folder, no byte of any file is written. With namespaces, it forks: only the
// new process returns, and this one waits for it and ends as it does (with code kExitBySignal + N
// for signal N). kStopSupervised ends both. Requires: one thread; with namespaces, at most
// kMountedFilesMax files. Errors: kUnavailable and similar; *missing is then the protection that
// could not be applied, or empty, and the process is of no use.
absl::Status Confine(const Confinement& confinement, Protections* missing);

}  // namespace sheaf::worker
