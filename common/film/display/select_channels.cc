// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/display/select_channels.h"

#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf {

absl::StatusOr<FrameImage> SelectChannels(const FrameImage& image,
                                          const std::vector<std::string>& channels,
                                          const std::vector<std::string>& names) {
  SHEAF_CHECK(channels.size() == names.size());
  FrameImage selected;
  selected.window = image.window;
  selected.frame_width_px = image.frame_width_px;
  selected.frame_height_px = image.frame_height_px;
  selected.color = image.color;
  selected.channel_names = names;
  for (const std::string& channel : channels) {
    const std::vector<float>* plane = image.Find(channel);
    if (plane == nullptr) {
      return absl::InternalError(absl::StrCat("the image has no channel ", channel));
    }
    selected.planes.push_back(*plane);
  }
  return selected;
}

}  // namespace sheaf
