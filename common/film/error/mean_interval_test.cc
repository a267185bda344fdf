// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests intervals of tiles whose samples follow known distributions: how often they contain the
// true mean, and that infinite variance is detected.
#include "common/film/error/mean_interval.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace sheaf {
namespace {

using Draw = std::function<double(std::mt19937_64&)>;

FilmTile TileOf(const Draw& draw, int32_t pixels, uint64_t samples, uint64_t seed) {
  std::mt19937_64 random(seed);
  FilmTile tile({0, 0, pixels, 1}, {0, samples});
  PixelAccumulator accumulator(&tile);
  for (int32_t x = 0; x < pixels; ++x) {
    accumulator.Begin(x, 0);
    for (uint64_t i = 0; i < samples; ++i) {
      accumulator.Add(i, {.radiance = Rgb::Gray(static_cast<float>(draw(random)))});
    }
    accumulator.End();
  }
  return tile;
}

constexpr std::array<double, 3> kGreen{0, 1, 0};
constexpr int kRuns = 1000;
constexpr int kLongRuns = 60;  // With many samples each.

MeanInterval IntervalOf(const FilmTile& tile) { return MeanIntervalOf(tile, tile.rect(), kGreen); }

struct Coverage {
  int reliable = 0, held = 0;
  double Fraction() const { return held / static_cast<double>(reliable); }
};
Coverage CoverageOf(const Draw& draw, double truth, int32_t pixels, uint64_t samples,
                    int runs = kRuns) {
  Coverage coverage;
  for (int run = 0; run < runs; ++run) {
    const MeanInterval interval =
        IntervalOf(TileOf(draw, pixels, samples, static_cast<uint64_t>(run)));
    if (!interval.is_reliable) continue;
    ++coverage.reliable;
    if (std::fabs(interval.mean - truth) <= interval.half_width) ++coverage.held;
  }
  return coverage;
}

double Uniform(std::mt19937_64& random) {
  return (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53;
}

// Student's t, two-sided 5 %, from tables.
TEST(MeanIntervalTest, QuantilesMatchStudentsDistribution) {
  EXPECT_NEAR(StudentQuantile975(10), 2.22814, 2e-3);
  EXPECT_NEAR(StudentQuantile975(15), 2.13145, 5e-4);
  EXPECT_NEAR(StudentQuantile975(30), 2.04227, 1e-4);
  EXPECT_NEAR(StudentQuantile975(1e9), 1.95996, 1e-5);
}

// 95 % of 1000 runs, with a standard deviation of 0.7 %; the tolerance is three of those plus the
// distribution's skewness.
TEST(MeanIntervalTest, IntervalsCoverTheMeanIn95Percent) {
  const Draw even = Uniform;
  const Draw exponential = [](std::mt19937_64& r) { return -std::log(Uniform(r)); };
  const Draw half_dark = [](std::mt19937_64& r) {
    const double u = Uniform(r);
    return u < 0.5 ? 0 : 4 * (u - 0.5);
  };
  for (const int32_t pixels : {1, 16, 64}) {
    SCOPED_TRACE(pixels);
    EXPECT_NEAR(CoverageOf(even, 0.5, pixels, 64).Fraction(), 0.95, 0.021);
    EXPECT_NEAR(CoverageOf(exponential, 1, pixels, 64).Fraction(), 0.95, 0.025);
    EXPECT_NEAR(CoverageOf(half_dark, 0.5, pixels, 64).Fraction(), 0.95, 0.021);
  }
  EXPECT_EQ(CoverageOf(even, 0.5, 16, 64).reliable, kRuns);
  EXPECT_EQ(CoverageOf(exponential, 1, 16, 64).reliable, kRuns);
}

// Pareto's distribution has no variance for a tail index of 2 and less, at any number of samples.
TEST(MeanIntervalTest, InfiniteVarianceIsDetected) {
  for (const double index : {1.1, 1.3, 1.5}) {
    SCOPED_TRACE(index);
    const Draw pareto = [&](std::mt19937_64& r) { return std::pow(Uniform(r), -1 / index); };
    EXPECT_EQ(CoverageOf(pareto, index / (index - 1), 64, 64).reliable, 0);
    EXPECT_EQ(CoverageOf(pareto, index / (index - 1), 64, 1024, kLongRuns).reliable, 0);
  }
}

// One sample in a thousand has all the light: with 64 of them most pixels have not seen any. A tile
// without any such sample cannot be distinguished from a dark one.
TEST(MeanIntervalTest, RareLightIsDetectedWhileRare) {
  const Draw rare = [](std::mt19937_64& r) { return Uniform(r) < 0.001 ? 1000 : 0; };
  for (uint64_t run = 0; run < kRuns; ++run) {
    const MeanInterval interval = IntervalOf(TileOf(rare, 64, 64, run));
    EXPECT_TRUE(!interval.is_reliable || interval.mean == 0) << run;
  }
  const MeanInterval often = IntervalOf(TileOf(rare, 16, 1 << 16, 7));
  EXPECT_TRUE(often.is_reliable);
  EXPECT_LT(std::fabs(often.mean - 1), 2 * often.half_width);
}

TEST(MeanIntervalTest, ConstantsHaveZeroWidth) {
  const MeanInterval interval = IntervalOf(TileOf([](std::mt19937_64&) { return 0.25; }, 4, 32, 1));
  EXPECT_EQ(interval.mean, 0.25);
  EXPECT_EQ(interval.half_width, 0);
  EXPECT_TRUE(interval.is_reliable);
}

}  // namespace
}  // namespace sheaf
