// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/shrink_image.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

std::vector<float> ShrinkPlane(const std::vector<float>& plane, int32_t width_px, int32_t factor,
                               int32_t small_width_px, int32_t small_height_px, bool squares) {
  std::vector<float> small;
  small.reserve(static_cast<size_t>(small_width_px) * static_cast<size_t>(small_height_px));
  const double count = double{1} * factor * factor;
  for (int32_t y = 0; y < small_height_px; ++y) {
    for (int32_t x = 0; x < small_width_px; ++x) {
      double sum = 0;
      for (int32_t row = y * factor; row < (y + 1) * factor; ++row) {
        const size_t start = static_cast<size_t>(row) * static_cast<size_t>(width_px) +
                             static_cast<size_t>(x) * static_cast<size_t>(factor);
        for (size_t i = start; i < start + static_cast<size_t>(factor); ++i) {
          const double value = plane[i];
          sum += squares ? value * value : value;
        }
      }
      small.push_back(static_cast<float>(squares ? std::sqrt(sum / count) : sum / count));
    }
  }
  return small;
}

}  // namespace

int32_t ShrinkFactor(int32_t width_px, int32_t height_px, int64_t pixel_count_max) {
  int32_t factor = 1;
  while (int64_t{width_px / factor} * (height_px / factor) > pixel_count_max &&
         factor < std::min(width_px, height_px)) {
    ++factor;
  }
  return factor;
}

absl::StatusOr<FrameImage> ShrinkImage(const FrameImage& image,
                                       const std::vector<std::string>& channels,
                                       int64_t pixel_count_max) {
  const int32_t width_px = image.window.Width();
  const int32_t factor = ShrinkFactor(width_px, image.window.Height(), pixel_count_max);
  FrameImage small;
  small.window = {0, 0, width_px / factor, image.window.Height() / factor};
  small.frame_width_px = small.window.Width();
  small.frame_height_px = small.window.Height();
  small.color = image.color;
  for (const std::string& channel : channels) {
    const std::vector<float>* plane = image.Find(channel);
    if (plane == nullptr) {
      return absl::InternalError(absl::StrCat("the image has no channel ", channel));
    }
    small.channel_names.push_back(channel);
    small.planes.push_back(ShrinkPlane(*plane, width_px, factor, small.window.Width(),
                                       small.window.Height(),
                                       absl::StartsWith(channel, "stderr.")));
  }
  return small;
}

}  // namespace sheaf
