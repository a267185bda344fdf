// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MeanInterval: a 95 % confidence interval for the mean of a region of the picture, from the spread
// of its replicates, and whether it can be trusted.
//
// Pixels are independent, so the variance of their mean is the mean of their variances over their
// number; its degrees of freedom are Satterthwaite's, from the 15 of each pixel. Source:
// Satterthwaite 1946, "An Approximate Distribution of Estimates of Variance Components".
//
// An interval is as true as the variance that was seen. Where light comes in rare bright samples,
// most of a pixel's squared deviations are those of one replicate: of 16 normal ones the largest
// has 0.29 on average, of one sample in a thousand that outshines the others 0.94, however bright
// it is. The share, averaged over pixels by their variances, is the mark: above kOneReplicateMax
// the interval is not to be trusted, and nothing that was seen tells how wide it would have to be.
// With more samples the share falls where the variance is finite, and does not where it is not.
#pragma once

#include <array>

#include "common/film/film_tile.h"

namespace sheaf {

inline constexpr double kOneReplicateMax = 0.5;

// What luminance weighs linear sRGB's red, green and blue with.
inline constexpr std::array<double, 3> kLuminanceOfSrgb{0.212639, 0.715169, 0.072192};

struct MeanInterval {
  double mean = 0;
  double standard_error = 0;
  double degrees_of_freedom = 0;  // At least 15 where standard_error is not 0.
  double half_width = 0;          // The mean is within this of the true one in 95 % of pictures.
  double one_replicate_share = 0;
  bool is_reliable = true;
};

// Of the weighted sum of red, green and blue over the pixels of `rect`, which lies in the tile.
// A pixel's deviations are the ratio estimator's (error_estimate.h). Requires: at least two
// replicates.
MeanInterval MeanIntervalOf(const FilmTile& sums, const PixelRect& rect,
                            const std::array<double, 3>& weights);

// The quantile of Student's distribution that leaves 2.5 % above. Within 0.1 % for 10 degrees of
// freedom and more, not below 3. Source: Hill 1970, "Algorithm 396: Student's t-quantiles".
double StudentQuantile975(double degrees_of_freedom);

}  // namespace sheaf
