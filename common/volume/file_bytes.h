// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FileBytes: random access to a file by position, so that a grid of gigabytes is read from disk to
// its destination without a second copy. PartedBytes: the same for a file that is in parts, each
// opened when it is first read.
#pragma once

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/base/status.h"

namespace sheaf::volume {

class FileBytes {
 public:
  // Errors: those of open(2), naming the file.
  static absl::StatusOr<FileBytes> Open(const std::string& file_name, const std::string& path) {
    return Adopt(file_name, ::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  }
  // Owns the open file from now on, also after an error. Errors: those of fstat(2), naming the
  // file.
  static absl::StatusOr<FileBytes> Adopt(const std::string& file_name, int descriptor) {
    FileBytes file;
    file.descriptor_ = descriptor;
    struct stat state {};
    if (descriptor < 0 || ::fstat(descriptor, &state) != 0) {
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

// Thread safety: const members may be called concurrently.
class PartedBytes {
 public:
  // Opens a part, by its number. It is asked again after an error.
  using OpenPart = std::function<absl::StatusOr<FileBytes>(size_t part)>;

  // A file that is whole.
  explicit PartedBytes(FileBytes file) : parts_(1) {
    parts_[0] = std::make_unique<Part>();
    parts_[0]->end_bytes = size_ = file.size();
    parts_[0]->file = std::make_unique<const FileBytes>(std::move(file));
    parts_[0]->open = parts_[0]->file.get();
  }
  // The parts follow each other.
  PartedBytes(const std::vector<uint64_t>& sizes_bytes, OpenPart open_part)
      : open_part_(std::move(open_part)) {
    for (const uint64_t bytes : sizes_bytes) {
      auto part = std::make_unique<Part>();
      part->begin_bytes = size_;
      part->end_bytes = size_ += bytes;
      parts_.push_back(std::move(part));
    }
  }

  uint64_t size() const { return size_; }
  // Errors: kDataLoss if the bytes are not all in one part, or the part is shorter than was said;
  // those of OpenPart.
  absl::Status Read(uint64_t offset_bytes, uint64_t size_bytes, void* out) const {
    const auto found = std::upper_bound(
        parts_.begin(), parts_.end(), offset_bytes,
        [](uint64_t at, const std::unique_ptr<Part>& part) { return at < part->end_bytes; });
    if (found == parts_.end()) return absl::DataLossError("it ends before these bytes");
    Part& part = **found;
    const FileBytes* file = part.open.load(std::memory_order_acquire);
    if (file == nullptr) {
      const absl::Status status = Open(&part, static_cast<size_t>(found - parts_.begin()));
      if (!status.ok()) return status;
      file = part.open.load(std::memory_order_acquire);
    }
    if (file->size() == part.end_bytes - part.begin_bytes &&
        file->Read(offset_bytes - part.begin_bytes, size_bytes, out)) {
      return absl::OkStatus();
    }
    return absl::DataLossError("it does not have these bytes");
  }

 private:
  struct Part {
    uint64_t begin_bytes = 0, end_bytes = 0;  // Where it is.
    std::atomic<const FileBytes*> open{nullptr};
    Mutex mutex;
    std::unique_ptr<const FileBytes> file ABSL_GUARDED_BY(mutex);
  };

  absl::Status Open(Part* part, size_t number) const {
    const MutexLock lock(&part->mutex);
    if (part->file != nullptr) return absl::OkStatus();  // Another thread has opened it.
    if (open_part_ == nullptr) return absl::UnavailableError("its parts are elsewhere");
    absl::StatusOr<FileBytes> file = open_part_(number);
    if (!file.ok()) return file.status();
    part->file = std::make_unique<const FileBytes>(*std::move(file));
    part->open.store(part->file.get(), std::memory_order_release);
    return absl::OkStatus();
  }

  uint64_t size_ = 0;
  const OpenPart open_part_;
  std::vector<std::unique_ptr<Part>> parts_;
};

}  // namespace sheaf::volume
