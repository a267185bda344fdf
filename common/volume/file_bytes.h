// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FileBytes: random access to a file by position, so that a grid of gigabytes is read from disk to
// its destination without a second copy.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "common/base/status.h"

namespace sheaf::volume {

class FileBytes {
 public:
  // Errors: those of open(2), naming the file.
  static absl::StatusOr<FileBytes> Open(const std::string& file_name, const std::string& path) {
    FileBytes file;
    file.descriptor_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    struct stat state {};
    if (file.descriptor_ < 0 || ::fstat(file.descriptor_, &state) != 0) {
      return StatusFromErrno(errno, file_name);
    }
    file.size_ = static_cast<uint64_t>(state.st_size);
    return file;
  }
  FileBytes(FileBytes&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, -1)), size_(other.size_) {}
  FileBytes& operator=(FileBytes&&) = delete;
  ~FileBytes() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }

  uint64_t size() const { return size_; }
  int descriptor() const { return descriptor_; }
  // True if all bytes were read, i.e. the file has them.
  bool Read(uint64_t offset_bytes, uint64_t size_bytes, void* out) const {
    constexpr uint64_t kReadBytesMax = uint64_t{1} << 30;
    if (offset_bytes > size_ || size_ - offset_bytes < size_bytes) return false;
    auto* at = static_cast<char*>(out);
    while (size_bytes > 0) {
      const ssize_t got = ::pread(descriptor_, at, std::min(size_bytes, kReadBytesMax),
                                  static_cast<off_t>(offset_bytes));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return false;
      at += got;
      offset_bytes += static_cast<uint64_t>(got);
      size_bytes -= static_cast<uint64_t>(got);
    }
    return true;
  }

 private:
  FileBytes() = default;
  int descriptor_ = -1;
  uint64_t size_ = 0;
};

}  // namespace sheaf::volume
