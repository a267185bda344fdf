// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SelectChannels: some channels of an image as an image of their own.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"

namespace sheaf {

inline const std::vector<std::string> kColorChannels = {"R", "G", "B"};

// The planes of the channels, under other names, in the window and colors of the image. Requires:
// as many names as channels. Errors: kInternal if the image lacks a channel.
absl::StatusOr<FrameImage> SelectChannels(const FrameImage& image,
                                          const std::vector<std::string>& channels,
                                          const std::vector<std::string>& names);

}  // namespace sheaf
