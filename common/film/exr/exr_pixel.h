// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads one pixel of an EXR, without decoding the others where the file allows that.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/exr/exr_codec.h"

namespace sheaf {

// All channels of the pixel (x_px, y_px) of the first part, by their names in the file, without
// subsampled ones. Cost: the lines that are compressed with the pixel's. Errors: kOutOfRange (the
// pixel is outside of the data window); those of ReadFrameImage.
absl::StatusOr<std::vector<std::pair<std::string, float>>> ReadImagePixel(
    const std::string& path, int32_t x_px, int32_t y_px, int64_t image_bytes_max = kImageBytesMax);

}  // namespace sheaf
