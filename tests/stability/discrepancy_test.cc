// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Discrepancies in closed form, and those of the points by which images are sampled.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tests/bench/discrepancy.h"
#include "tests/bench/sample_sets.h"

namespace sheaf::render {
namespace {

constexpr size_t kManyPoints = 1024;

TEST(DiscrepancyTest, OnePointInOneDimension) {
  // The integral of (t - [x < t])^2 over t: x^3 / 3 + (1 - x)^3 / 3.
  for (const double x : {0.0, 0.25, 0.5, 0.875}) {
    EXPECT_NEAR(L2StarSquared<1>({{x}}), (x * x * x + std::pow(1 - x, 3)) / 3, 1e-15) << x;
  }
  // No place on the torus is preferred.
  for (const double x : {0.0, 0.3, 0.9}) {
    EXPECT_NEAR(WrapAroundSquared<1>({{x}}), 1.5 - 4.0 / 3, 1e-15) << x;
  }
}

TEST(DiscrepancyTest, CentersOfEqualIntervals) {
  // 1 / (12 N^2), the least of N points.
  for (const size_t count : {1u, 4u, 37u}) {
    PointSet<1> points(count);
    for (size_t i = 0; i < count; ++i) {
      points[i][0] = (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    }
    const double expected = 1 / (12 * static_cast<double>(count * count));
    EXPECT_NEAR(L2StarSquared(points), expected, 1e-14) << count;
  }
}

// Expects that the mean of independent sets has its closed form within four standard errors.
template <size_t D>
void ExpectIndependentMeans() {
  constexpr int32_t kSets = 400;
  constexpr size_t kPoints = 64;
  const auto expect = [](const auto& measure, double expected) {
    double sum = 0, squares = 0;
    for (int32_t i = 0; i < kSets; ++i) {
      const double value = measure(IndependentPoints<D>(SetNumber{i}, kPoints));
      sum += value;
      squares += value * value;
    }
    const double mean = sum / kSets;
    const double error = std::sqrt((squares / kSets - mean * mean) / (kSets - 1));
    EXPECT_NEAR(mean, expected, 4 * error) << D;
    EXPECT_LT(error, expected / 10) << D;
  };
  expect(L2StarSquared<D>, IndependentL2StarSquared<D>(kPoints));
  expect(WrapAroundSquared<D>, IndependentWrapAroundSquared<D>(kPoints));
}

TEST(DiscrepancyTest, IndependentPointsHaveTheirClosedForm) {
  ExpectIndependentMeans<2>();
  ExpectIndependentMeans<4>();
}

TEST(DiscrepancyTest, SlotsAreAsEvenAsSobolsSequence) {
  const double sobol = L2StarSquared(SobolPoints<2>({}, kManyPoints));
  const double slot = MeanOverSets(SlotPoints<2>, L2StarSquared<2>, kManyPoints, 16);
  RecordProperty("slot_over_sobol", std::to_string(std::sqrt(slot / sobol)));
  EXPECT_LT(std::sqrt(slot), 1.5 * std::sqrt(sobol));
  const double sobol_torus = WrapAroundSquared(SobolPoints<2>({}, kManyPoints));
  const double slot_torus = MeanOverSets(SlotPoints<2>, WrapAroundSquared<2>, kManyPoints, 16);
  EXPECT_LT(std::sqrt(slot_torus), 1.5 * std::sqrt(sobol_torus));
}

TEST(DiscrepancyTest, PairsAcrossSlotsAreNoWorseThanIndependent) {
  const double pairs = MeanOverSets(SlotPairPoints, L2StarSquared<2>, kManyPoints, 64);
  EXPECT_LT(std::sqrt(pairs), 1.2 * std::sqrt(IndependentL2StarSquared<2>(kManyPoints)));
}

TEST(DiscrepancyTest, LightPathsOfAPassAreNoWorseThanIndependent) {
  const double paths = MeanOverSets(LightPassPoints, L2StarSquared<2>, kManyPoints, 64);
  EXPECT_LT(std::sqrt(paths), 1.2 * std::sqrt(IndependentL2StarSquared<2>(kManyPoints)));
}

// Replicates are independent of each other: 16 of n points have a sixteenth of the square of one.
TEST(DiscrepancyTest, ReplicatesAddUpAsIndependentSets) {
  const double together = MeanOverSets(ReplicatePoints, L2StarSquared<2>, kManyPoints, 16);
  const double alone =
      MeanOverSets(SlotPoints<2>, L2StarSquared<2>, kManyPoints / kReplicateCount, 64);
  EXPECT_NEAR(together / alone * kReplicateCount, 1, 0.3);
}

}  // namespace
}  // namespace sheaf::render
