// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The entry point of libsheaf_openimageio.so, which LoadImageLibrary looks up.
#include "common/image/image_library.h"
#include "common/image/openimageio/read_image.h"
#include "common/image/openimageio/texture_tiles.h"

extern "C" {
extern const sheaf::ImageLibrary sheaf_image_library;
const sheaf::ImageLibrary sheaf_image_library = {.read = sheaf::ReadByOpenImageIO,
                                                 .make_texture_tiles = sheaf::MakeOpenImageIOTiles};
}
