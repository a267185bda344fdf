// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The values of one pixel of an image so far.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace sheaf::coordinator {

struct PixelView {
  uint64_t version = 0;  // The FrameView::preview_version of the image.
  // Of all channels, linear, by their names in FrameImage.
  std::vector<std::pair<std::string, float>> channels;
};

}  // namespace sheaf::coordinator
