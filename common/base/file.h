// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whole files, written durably: once WriteFileAtomically returns OK, the file survives kill -9 and
// power loss. Many files at once: WriteFileUnsynced for each, then one FileSystemSync::Sync.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/statusor.h"

namespace sheaf {

// The file to which path leads, following symbolic links, also to a file that does not exist yet.
// Errors: kFailedPrecondition if it leads to a directory, a device or anything else but a regular
// file.
absl::StatusOr<std::string> FollowToFile(const std::string& path);
// Writes FILE.tmp-PID-N beside the FILE that FollowToFile returns, fsyncs it, renames it to FILE,
// fsyncs the directory. The umask decides who may read the file.
// Errors: also those of FollowToFile.
absl::Status WriteFileAtomically(const std::string& path, std::string_view bytes);
// The same without both fsyncs, for a file that only its owner may read: others see the whole file
// or none, but it survives power loss only once a later FileSystemSync::Sync returns OK. Requires:
// no file that must survive is replaced.
absl::Status WriteFileUnsynced(const std::string& path, std::string_view bytes);
// The same as WriteFileAtomically for a file that only its owner may read.
absl::Status WriteSecretAtomically(const std::string& path, std::string_view bytes);
// OK if WriteFileAtomically could start now: creates and removes an empty file beside path.
absl::Status CheckWritable(const std::string& path);
// Creates or replaces the file, for its owner alone. May leave a partial file if it fails or the
// machine stops.
absl::Status WriteFileOnce(const std::string& path, std::string_view bytes);
// Errors: kNotFound; kResourceExhausted beyond size_bytes_max.
absl::StatusOr<std::string> ReadWholeFile(const std::string& path,
                                          uint64_t size_bytes_max = uint64_t{1} << 34);
// Makes the folders of a path that are missing; only their owner may enter them.
absl::Status MakeDirectories(const std::string& path);

// A file system as a whole, named by one of its directories. Thread safety: all members may be
// called concurrently.
class FileSystemSync {
 public:
  // Errors: those of opening the directory.
  static absl::StatusOr<std::unique_ptr<FileSystemSync>> Open(const std::string& directory);
  ~FileSystemSync();
  FileSystemSync(const FileSystemSync&) = delete;
  FileSystemSync& operator=(const FileSystemSync&) = delete;

  // One syncfs(2): all files, names and folders that were changed before the call are durable when
  // it returns OK. Errors: of any file of the file system that could not be written since Open or
  // the last error; Linux says so from 5.8 on.
  absl::Status Sync() const;

 private:
  FileSystemSync(std::string directory, int fd) : directory_(std::move(directory)), fd_(fd) {}

  const std::string directory_;
  const int fd_;  // Stays open, for the kernel keeps the errors that were not told by descriptor.
};

// Makes a directory that only its owner may enter, or closes an existing one to others.
absl::Status MakePrivateDirectory(const std::string& path);

}  // namespace sheaf
