// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The inner loop of the denoiser: the sums of weighted neighbors, the taps, of a few pixels.
//
// A tap has two weights, one from each half of the replicates, and the weight of one half is
// applied to the value of the other. A half's weight is 0 where Welch's test finds, in any of R, G
// and B, that the two pixels have different means; otherwise it is the tap's spatial weight, and in
// the guided filter also that of the guides. Sources: Welch 1947, "The Generalization of Student's
// Problem when Several Different Population Variances are Involved"; Sakai et al. 2024, "A
// Statistical Approach to Monte Carlo Denoising", for the test as the weight of a filter.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace sheaf {

// Planes of features. Halves are the even and the odd one, each with R, G and B.
enum Feature : size_t {
  kMeanPlane = 0,         // 2 x 3.
  kVariancePlane = 6,     // 2 x 3: variances of the means, pooled over neighbors.
  kSpreadPlane = 12,      // 2 x 3: squared variances over their degrees of freedom.
  kGuidePlane = 18,       // 7: albedo, normal and alpha, over their tolerances.
  kDepthPlane = 25,       // The depth.
  kDepthScalePlane = 26,  // Half of the reciprocal of its squared tolerance.
  kValidPlane = 27,       // 1 where both halves have variances, otherwise 0.
  kFeatureCount = 28
};
inline constexpr size_t kGuideCount = 7;

// Pixels that are filtered together.
inline constexpr size_t kBlockSize = 8;
// The largest distance of a tap, in pixels, along x and along y.
inline constexpr size_t kTapReach = 8;

// The features of an image's pixels. A margin of kTapReach pixels of zeros surrounds the image, and
// rows are padded with zeros to whole blocks, so that all taps of all blocks exist.
class FeatureRows {
 public:
  FeatureRows(size_t width, size_t height);
  size_t stride() const { return stride_; }  // Between the planes of a pixel.
  size_t row_stride() const { return stride_ * kFeatureCount; }
  // Plane 0 of the pixel (0, y).
  float* Row(size_t y) { return values_.data() + (y + kTapReach) * row_stride() + kTapReach; }
  const float* Row(size_t y) const {
    return values_.data() + (y + kTapReach) * row_stride() + kTapReach;
  }

 private:
  size_t stride_;
  std::vector<float> values_;
};

struct Tap {
  ptrdiff_t offset = 0;  // From a pixel's features to those of its neighbor.
  float weight = 0;      // Spatial.
};

// Sums of a block's pixels: by filter, guided or not, and by the half that gives the weights: those
// of weighted differences of R, G and B from the pixel, and of the weights.
inline constexpr size_t kFilterCount = 2;
enum Filter : size_t { kGuided = 0, kUnguided = 1 };
struct TapSums {
  float sums[kFilterCount][2][4][kBlockSize] = {};
};

// pixel: plane 0 of the first of the block's pixels. A pixel's sums depend on nothing but the taps
// in their order and the features of the pixel and its neighbors.
TapSums SumTaps(const float* pixel, size_t stride, std::span<const Tap> taps);

}  // namespace sheaf
