// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whether two estimates of the same picture have the same expectation: Welch's t-test for every
// tile, and the Kolmogorov-Smirnov test of whether the p-values of all tiles are uniform, as they
// are where nothing but chance separates the estimates. One-sided p-values, so that an error which
// goes the same way everywhere adds up over the tiles, however small it is in each of them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sheaf::testing {

// P(T <= t) of Student's distribution; degrees_of_freedom > 0 need not be whole. Accurate to 1e-12.
double StudentCdf(double t, double degrees_of_freedom);

// Mean of independent draws of one distribution, and the variance of that mean.
struct Estimate {
  double mean = 0, variance = 0;
  int count = 0;
};
Estimate EstimateOf(const std::vector<double>& draws);

// P(a statistic at most as large as that of b - a), where both have the same expectation: small
// where b is less than a. The variances may differ. At least one must be positive.
// Source: Welch 1947.
double WelchP(const Estimate& a, const Estimate& b);

// The probability that uniform p-values are as far from uniform as these.
// Source: Kolmogorov 1933; for few values Stephens 1970.
double UniformityP(std::vector<double> p_values);

// The same tile by two techniques.
struct TilePair {
  Estimate a, b;
};
struct Agreement {
  double uniformity_p = 0;  // Of all tiles together.
  double extreme_p = 0;     // Of the tile furthest off, two-sided, Sidak-corrected.
  int tiles = 0;            // Without those that have no noise and are equal.
  double mean_ratio = 0;    // Of b's sum over that of a.
  std::string text;         // In one line, for messages.
};
// Every mean of b is multiplied by 1 + planted first.
Agreement Compare(const std::vector<TilePair>& tiles, double planted = 0);

// How probable it is that Compare's uniformity_p falls below the significance where b is 1 +
// planted times what it should be: by redrawing every tile's noise, with the variances that were
// measured.
double PowerOf(const std::vector<TilePair>& tiles, double planted, double significance,
               int redraws = 400, uint64_t seed = 1);

}  // namespace sheaf::testing
