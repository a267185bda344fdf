// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PixelReplicates: the standard error of a pixel from the spread of its replicates (film_tile.h).
//
// A pixel's value is the ratio sum / weight. With S_r and W_r the sums of replicate r, r = 1 .. R
// over the replicates that have samples, and m = sum S_r / sum W_r, its standard error is
//
//   sqrt(R / (R - 1) * sum (S_r - m W_r)^2) / |sum W_r|.
//
// For equal W_r this is sqrt(sum (m_r - m)^2 / (R (R - 1))), with m_r = S_r / W_r independent and
// identically distributed: m +- t(R - 1) * standard error is a Student interval. For unequal W_r (a
// sample count that 16 does not divide, or signed filters) it is the ratio estimator's, which does
// not need nonzero W_r. Differences are squared instead of subtracting squares, so it is never
// negative; its own rounding is about 2^-22 of the value, as replicate sums are float32. Source:
// Cochran 1977, Sampling Techniques, 3rd ed., sec. 2.11; Owen 1997 for the replicates.
#pragma once

#include <array>
#include <cstddef>

#include "common/film/film_tile.h"

namespace sheaf {

// The sums of a pixel's replicates, over those that have samples, and the standard errors from
// their spread.
class PixelReplicates {
 public:
  // p: index into the planes.
  PixelReplicates(const FilmTile& sums, size_t p);
  // For one color component (0..2 = R, G, B); 0 if fewer than 2 replicates have samples or the
  // weights sum to 0.
  double StandardError(size_t component) const;
  // The same for a weighted sum of R, G and B. Their errors are correlated, so it is computed from
  // the replicates' sums, not from the three errors.
  double StandardError(const std::array<double, 3>& weights) const;

 private:
  using Sums = std::array<float, kReplicateChannelCount>;
  template <typename ColorOf>
  double SpreadOf(const ColorOf& color_of) const;

  std::array<Sums, kReplicateCount> replicates_;
  size_t count_ = 0;
};

// The standard error of a weighted sum of R, G and B of the pixel `left` less that of the pixel
// `right`, whose replicates with equal numbers share paths. The residuals of both are subtracted in
// each replicate before they are squared, so that their correlation counts. 0 where PixelReplicates
// gives 0 for either pixel.
double StandardErrorOfDifference(const FilmTile& sums, size_t left, size_t right,
                                 const std::array<double, 3>& weights);

}  // namespace sheaf
