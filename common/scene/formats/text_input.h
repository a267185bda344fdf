// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TextInput: the bytes of a scene or mesh file in order, inflated if the file is gzip (detected by
// its first bytes, not by its name). The only file that uses zlib.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"

struct gzFile_s;  // zlib's file.

namespace sheaf {

class TextInput {
 public:
  // bytes_max bounds the total that Read returns, after inflating: a small file may inflate without
  // end.
  // Errors: kNotFound, kPermissionDenied, kInvalidArgument for a directory.
  static absl::StatusOr<std::unique_ptr<TextInput>> Open(const std::string& path,
                                                         uint64_t bytes_max);
  ~TextInput();
  TextInput(const TextInput&) = delete;
  TextInput& operator=(const TextInput&) = delete;

  // Returns the number of bytes stored in [into, into + size); 0 only at the end of the file. The
  // byte order mark of UTF-8, which editors put before the first byte, is skipped.
  // Errors: kResourceExhausted beyond bytes_max, kDataLoss for a broken or truncated gzip file,
  // kInvalidArgument for text in UTF-16.
  absl::StatusOr<size_t> Read(char* into, size_t size);

  // An upper bound on the bytes that the whole file can yield, from its size on disk.
  uint64_t size_bytes_bound() const { return size_bytes_bound_; }

 private:
  TextInput(gzFile_s* file, uint64_t size_bytes_bound, uint64_t bytes_max)
      : file_(file), size_bytes_bound_(size_bytes_bound), bytes_left_(bytes_max) {}

  gzFile_s* file_;
  uint64_t size_bytes_bound_;
  uint64_t bytes_left_;
  bool has_begun_ = false;
};

}  // namespace sheaf
