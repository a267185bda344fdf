// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How volume files compress: zlib and Blosc, from bytes to bytes of a size known beforehand.
#pragma once

#include <cstdint>
#include <span>

#include "common/volume/volume_grid.h"

namespace sheaf::volume {

// True where `packed` holds exactly out.size() bytes.
bool Unzip(std::span<const std::byte> packed, std::span<std::byte> out);
bool UnpackBlosc(std::span<const std::byte> packed, std::span<std::byte> out);

}  // namespace sheaf::volume
