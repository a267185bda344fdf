// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Attributes of an image's file with the types that other programs expect. In memory, attributes
// are texts:
//
//   int            "24"
//   float          "0.0125": six digits
//   rational       "24000/1001"
//   v2i            "1920x1080"
//   box2i          "0,0,1920,1080": x0, y0, x1, y1, half-open
//   m44f           16 numbers of nine digits, row by row; points are rows, multiplied from the left
//
// Source: OpenEXR 3.1, ImfStandardAttributes.h.
#pragma once

#include <ImfHeader.h>

#include <map>
#include <string>
#include <string_view>

#include "common/exr/exr_header_scan.h"
#include "common/film/frame_image.h"

namespace sheaf {

// Sets the image's metadata, as "sheaf:KEY", and its attributes. A text that its type cannot hold
// exactly, such as a seed above 2^31 - 1, is stored as a string.
void SetAttributes(const FrameImage& image, Imf::Header* header);
// Sets the standard screenWindowWidth and screenWindowCenter from the image's worldToCamera and
// worldToNDC; they stay 1 and 0 without perspective, as OpenEXR wants.
void SetScreenWindow(const FrameImage& image, Imf::Header* header);
// Sets those of a cryptomatte's layer ("CryptoObject00"), which programs want in its part.
void SetMatteAttributes(const FrameImage& image, std::string_view layer, Imf::Header* header);
// Reads what SetAttributes wrote: "sheaf:KEY" to metadata, "cryptomatte/..." and the standard ones
// to attributes.
void ReadAttributes(const ExrHeader& header, FrameImage* image);

}  // namespace sheaf
