// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PixelFeatures: planes of what the denoiser compares between pixels, with a margin around them.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/film/denoise/replicate_halves.h"

namespace sheaf {

// The largest distance of a neighbor, in pixels, along x and along y.
inline constexpr size_t kTapReach = 8;
// Pixels that are compared instead of one pixel: those at most this far away along x and along y.
inline constexpr size_t kPatchReach = 1;

// Thread safety: const members may be called concurrently.
class PixelFeatures {
 public:
  // Planes of one half.
  enum Plane : size_t {
    kMean = 0,      // R, G, B.
    kVariance = 3,  // Variances of the means.
    kPooled = 6,    // The same, averaged over neighbors, plus the floor.
    kSum = 9,       // The sum of the pooled variances of R, G and B.
    kGuide = 10,    // Over their tolerances; the depth as it is.
    kPlaneCount = kGuide + kGuideCount
  };

  // floor: a variance that differences of rounding do not exceed.
  PixelFeatures(const ReplicateHalves& halves, double floor);

  size_t width() const { return width_; }
  size_t height() const { return height_; }
  size_t stride() const { return stride_; }  // Between rows.
  // The pixel (0, y) of a plane; neighbors of the image's pixels may be read. Planes are 0 where
  // pixels are outside the image or not valid.
  const float* Row(size_t half, size_t plane, size_t y) const {
    return planes_[half * kPlaneCount + plane].data() + Offset(0, y);
  }
  // 1 where both halves have variances, otherwise 0.
  const float* ValidRow(size_t y) const { return valid_.data() + Offset(0, y); }

 private:
  static constexpr size_t kMargin = kTapReach + kPatchReach;
  size_t Offset(size_t x, size_t y) const { return (y + kMargin) * stride_ + x + kMargin; }
  void SetPooled(const ReplicateHalves::Half& half, size_t h, double floor);

  const size_t width_, height_, stride_;
  std::array<std::vector<float>, 2 * kPlaneCount> planes_;
  std::vector<float> valid_;
};

}  // namespace sheaf
