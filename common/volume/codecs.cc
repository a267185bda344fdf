// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/codecs.h"

#include <blosc.h>
#include <zlib.h>

namespace sheaf::volume {

bool Unzip(std::span<const std::byte> packed, std::span<std::byte> out) {
  uLongf size = out.size();
  return ::uncompress(reinterpret_cast<Bytef*>(out.data()), &size,
                      reinterpret_cast<const Bytef*>(packed.data()), packed.size()) == Z_OK &&
         size == out.size();
}

bool UnpackBlosc(std::span<const std::byte> packed, std::span<std::byte> out) {
  size_t size = 0;
  // Compares the head with the number of bytes available, and returns the uncompressed size.
  if (::blosc_cbuffer_validate(packed.data(), packed.size(), &size) < 0 || size != out.size()) {
    return false;
  }
  const int got = ::blosc_decompress_ctx(packed.data(), out.data(), out.size(), 1);
  return got >= 0 && static_cast<size_t>(got) == out.size();
}

std::vector<std::byte> PackBlosc(std::span<const std::byte> bytes, size_t value_bytes) {
  constexpr int kLevel = 5;
  std::vector<std::byte> packed(bytes.size() + BLOSC_MAX_OVERHEAD);
  const int size =
      ::blosc_compress_ctx(kLevel, BLOSC_SHUFFLE, value_bytes, bytes.size(), bytes.data(),
                           packed.data(), packed.size(), BLOSC_LZ4_COMPNAME, 0, 1);
  packed.resize(size > 0 ? static_cast<size_t>(size) : 0);
  return packed;
}

}  // namespace sheaf::volume
