// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Compression of volume files: zlib and Blosc, which unpack to a known number of bytes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/volume/volume_grid.h"

namespace sheaf::volume {

// True if `packed` decompresses to exactly out.size() bytes.
bool Unzip(std::span<const std::byte> packed, std::span<std::byte> out);
bool UnpackBlosc(std::span<const std::byte> packed, std::span<std::byte> out);

// Packs by Blosc (LZ4, bytes of values of `value_bytes` shuffled). Empty if that fails. The same
// bytes give the same result in any process with the same libraries.
std::vector<std::byte> PackBlosc(std::span<const std::byte> bytes, size_t value_bytes);

}  // namespace sheaf::volume
