// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Smaller copies of developed images, for display: whole squares of pixels become one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"

namespace sheaf {

// The smallest integer factor, at least 1, by which an image has at most pixel_count_max pixels.
int32_t ShrinkFactor(int32_t width_px, int32_t height_px, int64_t pixel_count_max);

// The given channels of an image, shrunk by that factor: means, and for standard errors the root
// mean square, so that they remain those of a pixel. Incomplete squares at the right and bottom
// edges are cut off.
// Errors: kInternal if there is no such channel.
absl::StatusOr<FrameImage> ShrinkImage(const FrameImage& image,
                                       const std::vector<std::string>& channels,
                                       int64_t pixel_count_max);

}  // namespace sheaf
