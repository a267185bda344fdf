// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_analysis.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace sheaf::cli {
namespace {

constexpr size_t kTiles = 200;
constexpr double kPixels = 256;

// A measurement whose variance falls as 1 / n^rate, with a bias.
StudyMeasurement MakeMeasurement(double variance, double bias_square, double rate,
                                 double seconds_per_sample, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(1, 0.05);
  StudyMeasurement measured;
  for (const double samples : {16.0, 32.0, 64.0, 128.0, 256.0}) {
    StudyCheckpoint& c = measured.checkpoints.emplace_back();
    c.samples = samples;
    c.cpu_seconds = seconds_per_sample * samples;
    for (size_t tile = 0; tile < kTiles; ++tile) {
      // Errors of tiles vary by a factor of a hundred.
      const double own = std::pow(10.0, 2 * static_cast<double>(tile) / kTiles - 1);
      const double expected = kPixels * own * variance / std::pow(samples, rate);
      c.variance.push_back(expected * noise(random));
      c.error.push_back((expected + kPixels * bias_square) * noise(random));
    }
  }
  return measured;
}

std::vector<StudyCurve> Analyze(std::vector<StudyMeasurement> measurements) {
  measurements.front().setting.is_base = true;
  return AnalyzeStudy(measurements, std::vector<double>(kTiles, kPixels));
}

TEST(StudyAnalysisTest, FitsTheVarianceRate) {
  const auto curves =
      Analyze({MakeMeasurement(1, 0, 1, 1, 1), MakeMeasurement(1, 0.01, 1.5, 1, 2)});
  ASSERT_TRUE(curves[0].rate && curves[1].rate);
  EXPECT_NEAR(curves[0].rate->value, 1, 0.03);
  EXPECT_NEAR(curves[1].rate->value, 1.5, 0.03);
  EXPECT_LT(curves[1].rate->error, 0.03);
}

TEST(StudyAnalysisTest, BiasIsErrorBeyondVariance) {
  const auto curves = Analyze({MakeMeasurement(1, 0, 1, 1, 3), MakeMeasurement(1, 0.01, 1, 1, 4)});
  ASSERT_TRUE(curves[0].bias_floor && curves[1].bias_floor);
  EXPECT_FALSE(curves[0].HasBias());
  EXPECT_TRUE(curves[1].HasBias());
  EXPECT_NEAR(curves[1].bias_floor->value, 0.01, 4 * curves[1].bias_floor->error);
}

// Half the variance at the same cost, and the same variance at half the cost, are both twice as
// fast.
TEST(StudyAnalysisTest, GainIsTheTimeRatioAtEqualError) {
  const auto curves = Analyze({MakeMeasurement(1, 0, 1, 1, 5), MakeMeasurement(0.5, 0, 1, 1, 6),
                               MakeMeasurement(1, 0, 1, 0.5, 7), MakeMeasurement(4, 0, 1, 1, 8)});
  EXPECT_FALSE(curves[0].gain);
  for (const size_t i : {1, 2}) {
    ASSERT_TRUE(curves[i].gain);
    EXPECT_NEAR(curves[i].gain->value, 2, 0.1);
    EXPECT_LT(curves[i].gain->error, 0.1);
  }
  EXPECT_NEAR(curves[3].gain->value, 0.25, 0.02);
}

TEST(StudyAnalysisTest, NoGainBeyondTheBaseCurve) {
  const auto curves = Analyze({MakeMeasurement(1, 0, 1, 1, 9), MakeMeasurement(1e-3, 0, 1, 1, 10)});
  EXPECT_FALSE(curves[1].gain);
}

TEST(StudyAnalysisTest, TimeUncertaintyFollowsTheSpreadOfRatios) {
  EXPECT_EQ(RatioDeviation({2, 4, 6}, {1, 2, 3}), 0);
  // Ratios 1 and 3: their mean is 2, its standard error 1.
  EXPECT_NEAR(RatioDeviation({1, 3}, {1, 1}), 0.5, 1e-12);
}

// The efficient front compares settings that render the same image, so it never runs through
// images of another depth.
TEST(StudyAnalysisTest, FrontHoldsNonDominatedUnbiasedSettings) {
  std::vector<StudyMeasurement> measurements = {
      MakeMeasurement(1, 0, 1, 1, 11), MakeMeasurement(1.5, 0, 1, 2, 12),
      MakeMeasurement(1, 0.05, 1, 0.1, 13), MakeMeasurement(0.9, 0, 1, 1, 17)};
  measurements[2].setting.is_unbiased = false;
  const auto curves = Analyze(measurements);
  for (const StudyPoint& point : curves[1].points) EXPECT_FALSE(point.on_pareto_front);
  // The biased setting is fastest by far.
  for (const StudyPoint& point : curves[2].points) EXPECT_FALSE(point.on_pareto_front);
  EXPECT_FALSE(curves[0].points.front().on_pareto_front);
  EXPECT_TRUE(curves[3].points.front().on_pareto_front);
}

}  // namespace
}  // namespace sheaf::cli
