// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads texels with OpenImageIO, inside the loaded module.
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "common/image/image_library.h"

namespace sheaf {

// Based on OpenImageIO's image cache. See ImageLibrary::make_texture_tiles.
std::unique_ptr<TextureTiles> MakeOpenImageIOTiles(uint64_t bytes_max,
                                                   void (*log_error)(std::string_view));

}  // namespace sheaf
