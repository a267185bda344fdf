// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FileState: detects changes of a file's bytes without reading them. Setting a file's modification
// time back still changes its ctime.
#pragma once

#include <sys/stat.h>

#include <cstdint>
#include <optional>
#include <string>

namespace sheaf {

struct FileState {
  uint64_t device = 0, inode = 0, size_bytes = 0;
  int64_t modified_ns = 0, changed_ns = 0;
  friend bool operator==(const FileState&, const FileState&) = default;
};

// None if there is no such file, or it cannot be accessed; errno has the reason.
inline std::optional<FileState> StateOfFile(const std::string& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return std::nullopt;
  const auto nanoseconds = [](const timespec& time) {
    return int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
  };
  return FileState{found.st_dev, found.st_ino, static_cast<uint64_t>(found.st_size),
                   nanoseconds(found.st_mtim), nanoseconds(found.st_ctim)};
}

}  // namespace sheaf
