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
// sample count that 16 does not divide, or signed filters) it is the ratio estimator's, which needs
// no weight W_r to differ from 0. Differences are squared, never squares subtracted, so it is never
// negative; its own rounding is about 2^-22 of the value, as replicate sums are float32.
// Source: Cochran 1977, Sampling Techniques, 3rd ed., sec. 2.11; Owen 1997 for the replicates.
#pragma once

#include <array>
#include <cstddef>

#include "common/film/film_tile.h"

namespace sheaf {

// The sums of a pixel's replicates, of those that have samples, and what their spread says.
class PixelReplicates {
 public:
  // p: index into the planes.
  PixelReplicates(const FilmTile& sums, size_t p);
  // Of one colour component (0..2 = R, G, B); 0 where fewer than 2 replicates have samples or the
  // weights sum to 0.
  double StandardError(size_t component) const;
  // The same of a weighted sum of R, G and B: their errors are correlated, so it is found from the
  // replicates' sums, not from the errors of the three.
  double StandardError(const std::array<double, 3>& weights) const;

 private:
  using Sums = std::array<float, kReplicateChannelCount>;
  template <typename ColorOf>
  double SpreadOf(const ColorOf& color_of) const;

  std::array<Sums, kReplicateCount> replicates_;
  size_t count_ = 0;
};

}  // namespace sheaf
