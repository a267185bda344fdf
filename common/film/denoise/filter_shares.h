// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The shares that the filters have in a pixel (denoise.h), and the estimate of its squared error as
// a quadratic function of them.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/film/denoise/block_filter.h"

namespace sheaf {

using Shares = std::array<double, kFilterCount>;

// The estimate of one pixel, or a sum of them: C + 2 (l0 linear[0] + l1 linear[1]) + l0^2 square[0]
// + l1^2 square[1] + 2 l0 l1 product, with l the shares.
struct SharesQuadratic {
  std::array<double, kFilterCount> linear{}, square{};
  double product = 0;
  // Without C.
  double At(const Shares& shares) const;
};

// The shares of at least 0 with a sum of at most 1 at which it is smallest; 0 if values are not
// finite.
Shares BestShares(const SharesQuadratic& quadratic);

// The sums of a pixel that the shares follow from; by filter, or pair of filters, and by R, G, B.
struct FilteredPixel {
  std::array<std::array<float, 3>, kFilterCount> change{}, gain{};  // e and G of denoise.h.
  std::array<std::array<float, 3>, kFilterPairCount> variance{};  // Variance of the changed image.
  std::array<std::array<float, 3>, kFilterCount> covariance{};    // Covariance with the image.
  std::array<float, kFilterCount> own_weight{};                   // The pixel's own weight.
  std::array<float, 3> image_variance{};                          // C.
  std::array<float, 3> importance{};                              // By which errors are weighed.

  SharesQuadratic QuadraticOf(size_t component) const;
  double ChangeAt(const Shares& shares, size_t component) const;
  // The variance of the image with these shares, for fixed weights.
  double VarianceAt(const Shares& shares, size_t component) const;
  // The weight that the pixel itself keeps.
  double OwnWeightAt(const Shares& shares) const;
};

// Sums of a plane over the squares around a row's pixels, always in the same order.
std::vector<double> SumSquares(const std::vector<float>& plane, size_t width, size_t height,
                               size_t y, int reach);

// The quadratics of all pixels, summed over R, G and B by importance.
class ShareChoice {
 public:
  ShareChoice(size_t width, size_t height);
  // Thread safety: distinct pixels may be set concurrently.
  void Set(size_t p, const FilteredPixel& pixel);
  // The shares of a row's pixels: best for the pixels at most `reach` away, without the pixel
  // itself. Its own noise must not choose, or the estimate at the chosen shares is too small.
  std::vector<Shares> Choose(size_t y, int reach) const;

 private:
  const size_t width_, height_;
  std::array<std::vector<float>, 5> terms_;  // The quadratic's linear, square, product.
};

}  // namespace sheaf
