// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The layer of an image that a PNG shows.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"

namespace sheaf::cli {

// Prefers the layers with less noise than the image: those of --denoise-with, then of --denoise.
// "image" if it has neither.
std::string LeastNoisyLayer(const FrameImage& image);

// The image with the layer's R, G and B as its own; name: "image", "denoised",
// "denoised_external", or "" for LeastNoisyLayer. Errors: kFailedPrecondition if it has no such
// layer, with the option that adds it.
absl::StatusOr<FrameImage> ImageOfLayer(const FrameImage& image, const std::string& name);

}  // namespace sheaf::cli
