// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VdbStream: a position in the bytes of a .vdb file. A read beyond the end fails permanently and
// gives zeros, so a reader checks only once, at the end of a unit.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>

#include "common/volume/codecs.h"

namespace sheaf::volume {

class VdbStream {
 public:
  VdbStream(std::span<const std::byte> bytes, uint64_t at) : bytes_(bytes), at_(at) {
    if (at > bytes.size()) Fail();
  }

  bool ok() const { return ok_; }
  uint64_t at() const { return at_; }
  void Fail() {
    ok_ = false;
    at_ = bytes_.size();
  }
  bool Skip(uint64_t size_bytes) {
    if (!ok_ || size_bytes > bytes_.size() - at_) {
      Fail();
      return false;
    }
    at_ += size_bytes;
    return true;
  }
  void Read(void* out, uint64_t size_bytes) {
    const uint64_t from = at_;
    if (Skip(size_bytes)) {
      if (size_bytes > 0) std::memcpy(out, bytes_.data() + from, size_bytes);
    } else {
      std::memset(out, 0, size_bytes);
    }
  }
  template <typename T>
  T Get() {
    T value;
    Read(&value, sizeof(value));
    return value;
  }
  std::string GetString() {
    constexpr uint32_t kStringBytesMax = 1 << 16;
    const auto size = Get<uint32_t>();
    if (size > kStringBytesMax) Fail();
    std::string text(ok_ ? size : 0, '\0');
    Read(text.data(), text.size());
    return text;
  }
  // The contents of a metadata map are not needed to read a tree.
  void SkipMetadata() {
    const auto count = Get<uint32_t>();
    for (uint32_t i = 0; i < count && ok_; ++i) {
      GetString();
      GetString();
      Skip(Get<uint32_t>());
    }
  }
  // A block of values: either raw, or its length and then compressed; a length of zero or less
  // means that compression did not help. out.data() == nullptr: skips the block.
  void ReadBlock(uint32_t compression, std::span<std::byte> out) {
    if ((compression & (kZip | kBlosc)) == 0) {
      out.data() != nullptr ? Read(out.data(), out.size()) : void(Skip(out.size()));
      return;
    }
    const auto packed = Get<int64_t>();
    const uint64_t from = at_;
    const uint64_t size =
        packed > 0 ? static_cast<uint64_t>(packed) : 0 - static_cast<uint64_t>(packed);
    if (!Skip(size) || out.data() == nullptr) return;
    const auto in = bytes_.subspan(from, size);
    if (packed <= 0) {
      if (size != out.size()) return Fail();
      if (size > 0) std::memcpy(out.data(), in.data(), size);
    } else if (!((compression & kBlosc) != 0 ? UnpackBlosc(in, out) : Unzip(in, out))) {
      Fail();
    }
  }

  // Bits of a grid's compression.
  static constexpr uint32_t kZip = 1, kActiveMask = 2, kBlosc = 4;

 private:
  std::span<const std::byte> bytes_;
  uint64_t at_;
  bool ok_ = true;
};

}  // namespace sheaf::volume
