// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ImageSource: the bytes of a NanoVDB image by position: in memory, or in a file, of which only a
// window is in memory.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "common/volume/file_bytes.h"
#include "common/volume/volume_grid.h"

namespace sheaf::volume {

class ImageSource {
 public:
  explicit ImageSource(VolumeBytes image) : image_(std::move(image)), size_(image_.size()) {}
  // size_bytes at offset_bytes of a file, which outlives the object.
  ImageSource(const FileBytes& file, uint64_t offset_bytes, uint64_t size_bytes)
      : file_(&file), begin_(offset_bytes), size_(size_bytes) {}

  uint64_t size() const { return size_; }
  // False if the image does not have these bytes.
  bool Read(uint64_t offset, uint64_t size, void* out) {
    if (offset > size_ || size_ - offset < size) return false;
    if (file_ == nullptr) {
      std::memcpy(out, image_.data() + offset, size);
      return true;
    }
    if (size > kWindowBytes) return file_->Read(begin_ + offset, size, out);
    if (offset < window_at_ || offset + size > window_at_ + window_.size()) {
      window_.resize(std::min(kWindowBytes, size_ - offset));
      window_at_ = offset;
      if (!file_->Read(begin_ + offset, window_.size(), window_.data())) {
        window_.clear();
        return false;
      }
    }
    std::memcpy(out, window_.data() + (offset - window_at_), size);
    return true;
  }

 private:
  static constexpr uint64_t kWindowBytes = uint64_t{256} << 10;

  VolumeBytes image_;
  const FileBytes* file_ = nullptr;
  uint64_t begin_ = 0, size_ = 0;
  std::vector<std::byte> window_;
  uint64_t window_at_ = 0;
};

}  // namespace sheaf::volume
