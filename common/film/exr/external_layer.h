// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The layer that a denoiser of another maker made, in a copy of a delivered image: it is not a part
// of the image that was delivered, whose digest has no such channels.
#pragma once

#include <array>
#include <vector>

#include "common/film/frame_image.h"

namespace sheaf {

inline constexpr char kExternalLayer[] = "denoised_external";

// Adds or replaces the channels R, G and B of the layer. Requires: planes of the image's size.
void SetExternalLayer(std::array<std::vector<float>, 3> planes, FrameImage* image);
// The image as it was delivered.
void RemoveExternalLayer(FrameImage* image);

}  // namespace sheaf
