// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts linear images for display on a screen.
#pragma once

#include <vector>

#include "common/film/frame_image.h"
#include "common/image/image_io.h"

namespace sheaf::cli {

// The channels R, G, B, converted to the primaries of sRGB, clamped to [0, 1] and encoded by the
// sRGB curve. There is no exposure and no other curve, so that a PNG shows the EXR's values.
// Row-major over the image's window. Degenerate primaries are replaced by sRGB's. Requires: R, G
// and B exist.
std::vector<Rgb8> ToneMapSrgb(const FrameImage& image);

}  // namespace sheaf::cli
