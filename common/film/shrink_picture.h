// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Smaller copies of developed pictures, for looking at: whole squares of pixels become one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_picture.h"

namespace sheaf {

// The smallest whole factor by which a picture has at most pixel_count_max pixels, and at least
// one.
int32_t ShrinkFactor(int32_t width_px, int32_t height_px, int64_t pixel_count_max);

// The given channels of a picture, shrunk by that factor: means, and of standard errors the roots
// of mean squares, so that they stay those of a pixel. What is left over at the right and bottom
// edges is cut off. Errors: kInternal where there is no such channel.
absl::StatusOr<FramePicture> ShrinkPicture(const FramePicture& picture,
                                           const std::vector<std::string>& channels,
                                           int64_t pixel_count_max);

}  // namespace sheaf
