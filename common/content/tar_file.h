// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TarWriter and TarReader: files in one file, in the plainest form of tar (POSIX.1-1988 ustar):
// regular files with short names, readable by all users, without owner or times. Equal files give
// equal bytes, and every byte that is not content is known: the reader refuses any other.
#pragma once

#include <cstdint>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace sheaf {

inline constexpr size_t kTarNameBytesMax = 99;
inline constexpr uint64_t kTarFileBytesMax = (uint64_t{1} << 33) - 1;  // 11 octal digits.

// Thread safety: one thread at a time.
class TarWriter {
 public:
  // Creates or replaces the file. Errors: those of the system.
  static absl::StatusOr<std::unique_ptr<TarWriter>> Create(const std::string& path);

  // Begins a file, whose bytes follow. Requires: the file before it is complete; name is printable,
  // and has 1 to kTarNameBytesMax bytes. Errors: kInvalidArgument beyond kTarFileBytesMax; those of
  // the disk.
  absl::Status Begin(std::string_view name, uint64_t size_bytes);
  // Errors: kInvalidArgument beyond the file's size; those of the disk.
  absl::Status Append(std::string_view bytes);
  // Bytes that the present file still lacks.
  uint64_t bytes_left() const { return bytes_left_; }
  // Ends the whole. Call once, last. Requires: the last file is complete. Errors: those of the
  // disk.
  absl::Status Finish();

 private:
  explicit TarWriter(std::string path) : path_(std::move(path)) {}
  absl::Status Write(std::string_view bytes);

  const std::string path_;
  std::ofstream file_;
  uint64_t size_bytes_ = 0, bytes_left_ = 0;  // Present file.
};

// A file in a tar file.
struct TarEntry {
  std::string name;
  uint64_t offset_bytes = 0;  // Its first byte in the tar file.
  uint64_t size_bytes = 0;
};

// Returns the bytes of the tar file from an offset on. Requires: they are there.
using ReadBytesAt =
    std::function<absl::StatusOr<std::string>(uint64_t offset_bytes, uint64_t size_bytes)>;

// The files of a tar file of TarWriter, in order; reads the headers only. The bytes are untrusted.
// Errors: kDataLoss, naming the place: no such file, cut short, or altered; kResourceExhausted
// beyond entry_count_max; those of read.
absl::StatusOr<std::vector<TarEntry>> ListTar(const ReadBytesAt& read, uint64_t size_bytes,
                                              size_t entry_count_max);

// Reads a file at offsets. Errors: those of the system; kDataLoss where it has become shorter.
absl::StatusOr<ReadBytesAt> OpenForReading(const std::string& path, uint64_t* size_bytes);

}  // namespace sheaf
