// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MeanInterval: a 95 % confidence interval for the mean of a region of the image, from the spread
// of its replicates, and whether it can be trusted.
//
// Pixels are independent, so the variance of their mean is the mean of their variances over their
// number; its degrees of freedom are Satterthwaite's, from the 15 of each pixel. Source:
// Satterthwaite 1946, "An Approximate Distribution of Estimates of Variance Components".
//
// An interval is only as accurate as the observed variance. If light comes in rare bright samples,
// one replicate makes most of a pixel's squared deviations: the largest of 16 normal ones has a
// fraction of 0.29 on average, while one sample in a thousand that is far brighter than the others
// has 0.94, however bright it is. The test is this fraction, averaged over pixels by their
// variances: above kOneReplicateMax the interval is unreliable, and the samples do not tell how
// wide it should be. With more samples the fraction falls if the variance is finite, and otherwise
// does not.
#pragma once

#include <array>

#include "common/film/film_tile.h"

namespace sheaf {

inline constexpr double kOneReplicateMax = 0.5;

// Weights of linear sRGB's red, green and blue in luminance.
inline constexpr std::array<double, 3> kLuminanceOfSrgb{0.212639, 0.715169, 0.072192};

struct MeanInterval {
  double mean = 0;
  double standard_error = 0;
  double degrees_of_freedom = 0;  // At least 15 if standard_error is not 0.
  double half_width = 0;  // The mean is within this distance of the true one in 95 % of images.
  double one_replicate_fraction = 0;
  bool is_reliable = true;
};

// Whether the error of the sum of two independent means can be trusted, by the same test.
bool IsSumReliable(const MeanInterval& a, const MeanInterval& b);

// For the weighted sum of red, green and blue over the pixels of `rect`, which lies in the tile. A
// pixel's deviations are the ratio estimator's (error_estimate.h).
// Requires: at least two replicates.
MeanInterval MeanIntervalOf(const FilmTile& sums, const PixelRect& rect,
                            const std::array<double, 3>& weights);

// The 97.5 % quantile of Student's distribution. Within 0.1 % for 10 degrees of freedom and more;
// fewer than 3 count as 3. Source: Hill 1970, "Algorithm 396: Student's t-quantiles".
double StudentQuantile975(double degrees_of_freedom);

}  // namespace sheaf
