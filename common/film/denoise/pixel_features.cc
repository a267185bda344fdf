// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/pixel_features.h"

#include <algorithm>

namespace sheaf {
namespace {

// Variances are pooled over pixels at most this far away.
constexpr size_t kPoolReach = 1;
// Differences of guides at which the guided filter's weight becomes 0, in the order of
// kGuideChannels; that of the depth is in block_filter.cc.
constexpr std::array<float, kGuideCount> kTolerances{0.3F, 0.3F, 0.3F,  0.9F,
                                                     0.9F, 0.9F, 0.75F, 1.0F};

}  // namespace

PixelFeatures::PixelFeatures(const ReplicateHalves& halves, double floor)
    : width_(static_cast<size_t>(halves.window().Width())),
      height_(static_cast<size_t>(halves.window().Height())),
      stride_(width_ + 2 * kMargin) {
  const size_t size = stride_ * (height_ + 2 * kMargin);
  for (std::vector<float>& plane : planes_) plane.resize(size);
  valid_.resize(size);
  for (size_t y = 0; y < height_; ++y) {
    for (size_t x = 0; x < width_; ++x) {
      const size_t from = y * width_ + x, to = Offset(x, y);
      const bool is_valid =
          halves.half(0).replicate_count[from] >= 2 && halves.half(1).replicate_count[from] >= 2;
      if (!is_valid) continue;
      valid_[to] = 1;
      for (size_t h = 0; h < 2; ++h) {
        const ReplicateHalves::Half& half = halves.half(h);
        const auto plane = [&](size_t index) -> float& {
          return planes_[h * kPlaneCount + index][to];
        };
        for (size_t i = 0; i < 3; ++i) {
          plane(kMean + i) = half.mean[i][from];
          plane(kVariance + i) = half.variance[i][from];
        }
        for (size_t k = 0; k < kGuideCount; ++k) {
          plane(kGuide + k) = half.guides[k][from] / kTolerances[k];
        }
      }
    }
  }
  for (size_t h = 0; h < 2; ++h) SetPooled(halves.half(h), h, floor);
}

void PixelFeatures::SetPooled(const ReplicateHalves::Half& half, size_t h, double floor) {
  const auto first = [](size_t i) { return i < kPoolReach ? size_t{0} : i - kPoolReach; };
  for (size_t y = 0; y < height_; ++y) {
    for (size_t x = 0; x < width_; ++x) {
      const size_t to = Offset(x, y);
      if (valid_[to] == 0) continue;
      std::array<double, 3> sums{};
      double count = 0;
      for (size_t j = first(y); j <= std::min(y + kPoolReach, height_ - 1); ++j) {
        for (size_t i = first(x); i <= std::min(x + kPoolReach, width_ - 1); ++i) {
          if (valid_[Offset(i, j)] == 0) continue;
          ++count;
          for (size_t c = 0; c < 3; ++c) sums[c] += double{half.variance[c][j * width_ + i]};
        }
      }
      double sum = 0;
      for (size_t c = 0; c < 3; ++c) {
        const double pooled = sums[c] / count + floor;
        planes_[h * kPlaneCount + kPooled + c][to] = static_cast<float>(pooled);
        sum += pooled;
      }
      planes_[h * kPlaneCount + kSum][to] = static_cast<float>(sum);
    }
  }
}

}  // namespace sheaf
