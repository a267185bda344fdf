// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The inner loop of the denoiser: the sums of weighted neighbors, the taps, of a block of pixels.
//
// A tap has two weights, one from each half of the replicates, and the weight of one half is
// applied to the light of the other. With t^2 the squared statistic of Welch's test of two pixels'
// means, averaged over R, G, B and over the pixels of a patch, which is about 1 where means are
// equal, a half's weight is
//
//     s min(1, v_p / v_q) clamp(2 - t^2, 0, 1),
//
// with s the tap's spatial weight and v the pooled variances of the pixel p and its neighbor q: a
// neighbor that is noisier counts less. In the guided filter the weight is also multiplied by that
// of the half's guides. Sources: Welch 1947, "The Generalization of Student's Problem when Several
// Different Population Variances are Involved"; Sakai et al. 2024, "A Statistical Approach to Monte
// Carlo Denoising", for the test as the weight of a filter; Buades et al. 2005, "A Non-Local
// Algorithm for Image Denoising", for patches.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/film/denoise/pixel_features.h"

namespace sheaf {

// Pixels that are filtered together.
inline constexpr size_t kBlockWidth = 64, kBlockRows = 16;

enum Filter : size_t { kUnguided = 0, kGuided = 1, kFilterCount = 2 };
// The pairs of filters whose weights are multiplied.
inline constexpr size_t kFilterPairCount = 3;  // Unguided twice, both, guided twice.

// Sums of one pixel with the weights of one half over its neighbors, itself included with weight 1.
struct TapSums {
  std::array<float, kFilterCount> weight{};                 // Sums of the weights.
  std::array<std::array<float, 3>, kFilterCount> change{};  // Sums of weights times differences of
                                                            // light from the pixel.
  std::array<std::array<float, 3>, kFilterPairCount> variance{};  // Sums of products of weights
                                                                  // times variances.
};

// Thread safety: none; one for each thread.
class BlockFilter {
 public:
  // The features must outlive it.
  explicit BlockFilter(const PixelFeatures& features);
  // Sums the taps of the block whose first pixel is (x0, y0); x1, y1: its end, excluded. A pixel's
  // sums depend on nothing but the features of pixels around it, and are added in one order.
  void Run(size_t x0, size_t y0, size_t x1, size_t y1);
  // half: that of the weights. x, y: a valid pixel of the block.
  TapSums At(size_t half, size_t x, size_t y) const;

 private:
  struct Tap {
    ptrdiff_t dx = 0, dy = 0;
    float weight = 0;
  };
  // A half has weights, changes and products of variances, each for all pixels of the block.
  static constexpr size_t kSumCount = kFilterCount * 4 + kFilterPairCount * 3;
  using BlockPlane = std::array<float, kBlockWidth * kBlockRows>;

  void AddTap(size_t half, const Tap& tap);
  void SetPatchSums(size_t half, const Tap& tap, size_t row);
  void SetWeights(size_t half, const Tap& tap, size_t row, float* unguided, float* guided) const;

  const PixelFeatures& features_;
  std::vector<Tap> taps_;
  size_t x0_ = 0, y0_ = 0, width_ = 0, rows_ = 0;
  std::array<std::array<BlockPlane, kSumCount>, 2> sums_;
  // Sums of t^2 over rows of patches, and their numbers of pixels.
  std::array<std::array<float, kBlockWidth>, kBlockRows + 2 * kPatchReach> squares_, counts_;
};

}  // namespace sheaf
