// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests whether two estimates of the same image have the same expectation: Welch's t-test for every
// tile, and the Kolmogorov-Smirnov test of whether the p-values of all tiles are uniform, as they
// are if only chance separates the estimates. The p-values are one-sided, so that an error of the
// same sign everywhere accumulates over the tiles, however small it is in each of them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sheaf::testing {

// P(T <= t) of Student's distribution; degrees_of_freedom > 0, not necessarily an integer. Accurate
// to 1e-12.
double StudentCdf(double t, double degrees_of_freedom);

// Mean of independent draws from one distribution, and the variance of that mean.
struct Estimate {
  double mean = 0, variance = 0;
  int count = 0;
};
Estimate EstimateOf(const std::vector<double>& draws);

// Probability of a statistic at most as large as that of b - a if both have the same expectation:
// small if b is less than a. The variances may differ; at least one must be positive. Source: Welch
// 1947.
double WelchP(const Estimate& a, const Estimate& b);

// The probability that uniform p-values deviate from uniformity as much as these. Source:
// Kolmogorov 1933; for few values Stephens 1970.
double UniformityP(std::vector<double> p_values);

// One tile estimated by two techniques.
struct TilePair {
  Estimate a, b;
};
struct Agreement {
  double uniformity_p = 0;  // Over all tiles.
  double extreme_p = 0;     // For the most deviating tile, two-sided, Sidak-corrected.
  int tiles = 0;            // Excludes tiles without noise that are equal.
  double mean_ratio = 0;    // Sum of b over the sum of a.
  std::string text;         // The result in one line, for messages.
};
// Each mean of b is first multiplied by 1 + planted.
Agreement Compare(const std::vector<TilePair>& tiles, double planted = 0);

// Probability that Compare's uniformity_p falls below the significance if b is 1 + planted times
// its correct value. Estimated by redrawing every tile's noise with the measured variances.
double PowerOf(const std::vector<TilePair>& tiles, double planted, double significance,
               int redraws = 400, uint64_t seed = 1);

}  // namespace sheaf::testing
