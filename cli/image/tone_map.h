// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Linear pictures to what a screen shows.
#pragma once

#include <vector>

#include "common/film/frame_picture.h"
#include "common/image/image_io.h"

namespace sheaf::cli {

// The channels R, G, B, converted to the primaries of sRGB, through the sRGB curve, cut to [0, 1]
// before; no exposure, no other curve, so that a PNG says what the EXR says. Row-major over the
// picture's window. Primaries that are degenerate are taken for sRGB's. Requires: R, G and B
// are there.
std::vector<Rgb8> ToneMapSrgb(const FramePicture& picture);

}  // namespace sheaf::cli
