// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Decompression for volume files: zlib and Blosc, to a known number of bytes.
#pragma once

#include <cstdint>
#include <span>

#include "common/volume/volume_grid.h"

namespace sheaf::volume {

// True if `packed` decompresses to exactly out.size() bytes.
bool Unzip(std::span<const std::byte> packed, std::span<std::byte> out);
bool UnpackBlosc(std::span<const std::byte> packed, std::span<std::byte> out);

}  // namespace sheaf::volume
