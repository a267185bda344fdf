// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The layer of an image that a PNG shows.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"

namespace sheaf::cli {

// The layers with less noise than the image, the one to show first: those of --denoise-with and of
// --denoise. Of an image without either it is "image".
std::string LeastNoisyLayer(const FrameImage& image);

// The image with the layer's R, G and B as its own; name: "image", "denoised",
// "denoised_external", or "" for LeastNoisyLayer. Errors: kFailedPrecondition if it has no such
// layer, with the option that adds it.
absl::StatusOr<FrameImage> ImageOfLayer(const FrameImage& image, const std::string& name);

}  // namespace sheaf::cli
