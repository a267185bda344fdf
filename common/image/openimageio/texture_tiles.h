// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Texels by OpenImageIO, for what is loaded with it.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "common/image/image_library.h"

namespace sheaf {

// On OpenImageIO's image cache. See ImageLibrary::make_texture_tiles.
std::unique_ptr<TextureTiles> MakeOpenImageIOTiles(uint64_t bytes_max,
                                                   void (*log_error)(std::string_view));

}  // namespace sheaf
