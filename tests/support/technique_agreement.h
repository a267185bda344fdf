// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The test of whether two techniques have the same expectation. Each scene is rendered by both from
// independent seeds and compared tile by tile. Pixels and replicates are independent, so the 16
// replicates of a tile are 16 draws for Welch's t-test, and the p-values of all tiles of all scenes
// must be uniform.
//
// Significance: kSignificance for each pair of techniques, for the Kolmogorov-Smirnov test and for
// the most deviating tile (the seeds are fixed: a test that passes once always passes). Power: a
// bias must be detected with probability kPowerMin at that significance, in draws with the
// variances of the actual renderings, and when it is added to the renderings themselves.
#pragma once

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "common/film/film_tile.h"
#include "gtest/gtest.h"
#include "tests/support/agreement.h"
#include "tests/support/long_tests.h"

namespace sheaf::testing {

inline constexpr double kSignificance = 1e-3;
inline constexpr double kPowerMin = 0.99;
// The bias that must be detected; a larger one for two techniques that are both noisy somewhere.
inline double Bias() { return LongTests() ? 0.0025 : 0.01; }
inline double BiasOfNoisyPair() { return 1.5 * Bias(); }
// As many per pixel as the power needs: ExpectAgreement fails if they are too few.
inline uint64_t Samples(uint64_t in_short) { return LongTests() ? 2048 : in_short; }

// The edge of the square image, and of its tiles.
inline constexpr int32_t kSizePx = 48, kTileSizePx = 6;

// Estimates of the mean of the channels in each tile. sum_of(replicate, pixel): the sum of R, G and
// B; weight_of(replicate, pixel).
template <typename SumOf, typename WeightOf>
std::vector<Estimate> EstimatesOfTiles(uint32_t replicates, const SumOf& sum_of,
                                       const WeightOf& weight_of) {
  std::vector<Estimate> estimates;
  for (int32_t y0 = 0; y0 < kSizePx; y0 += kTileSizePx) {
    for (int32_t x0 = 0; x0 < kSizePx; x0 += kTileSizePx) {
      std::vector<double> draws;
      for (uint32_t r = 0; r < replicates; ++r) {
        double sum = 0, weight = 0;
        for (int32_t y = y0; y < y0 + kTileSizePx; ++y) {
          for (int32_t x = x0; x < x0 + kTileSizePx; ++x) {
            const auto pixel = static_cast<size_t>(y * kSizePx + x);
            sum += sum_of(r, pixel);
            weight += weight_of(r, pixel);
          }
        }
        draws.push_back(sum / weight);
      }
      estimates.push_back(EstimateOf(draws));
    }
  }
  return estimates;
}

// The box filter gives every sample the same weight.
inline std::vector<Estimate> EstimatesOf(const FilmTile& film) {
  return EstimatesOfTiles(
      film.replicate_count(),
      [&](uint32_t r, size_t pixel) {
        double sum = 0;
        for (size_t c = 0; c < 3; ++c) sum += static_cast<double>(film.replicate(r, c)[pixel]);
        return sum;
      },
      [&](uint32_t r, size_t pixel) { return static_cast<double>(film.replicate(r, 3)[pixel]); });
}

// The techniques agree, and a disagreement would have been detected.
inline void ExpectAgreement(const std::string& name, double bias,
                            const std::vector<TilePair>& tiles) {
  const Agreement agreement = Compare(tiles);
  EXPECT_GT(agreement.uniformity_p, kSignificance) << agreement.text;
  EXPECT_GT(agreement.extreme_p, kSignificance) << agreement.text;
  const double power_up = PowerOf(tiles, bias, kSignificance);
  const double power_down = PowerOf(tiles, -bias, kSignificance);
  EXPECT_GE(power_up, kPowerMin);
  EXPECT_GE(power_down, kPowerMin);
  for (const double planted : {bias, -bias}) {
    const Agreement biased = Compare(tiles, planted);
    EXPECT_LT(biased.uniformity_p, kSignificance) << "planted " << planted << ": " << biased.text;
  }
  std::printf("%s: %s; a bias of %.2f %% found with probability %.3f\n", name.c_str(),
              agreement.text.c_str(), 100 * bias, std::min(power_up, power_down));
}

}  // namespace sheaf::testing
