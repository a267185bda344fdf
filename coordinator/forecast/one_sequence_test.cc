// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/one_sequence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace sheaf::coordinator {
namespace {

// A point of an error curve: cells of 500 pixels each, with the given samples. Their errors fall at
// `rate` and have the relative standard deviation `deviation`.
RoundRecord Point(const std::vector<uint64_t>& samples, double rate, double deviation) {
  RoundRecord point;
  double noise = 1;
  for (const uint64_t n : samples) {
    CellRound cell{n, {500, 500 * noise * std::pow(static_cast<double>(n), -rate), 0}};
    cell.error.square_sum = cell.error.sum * cell.error.sum * deviation * deviation / 2;
    point.cells.push_back(cell);
    noise *= 100;
  }
  return point;
}

// A curve of doublings up to `samples`.
std::vector<RoundRecord> Curve(uint64_t samples, double rate, double deviation) {
  std::vector<RoundRecord> points;
  for (uint64_t n = 16; n <= samples; n *= 2) points.push_back(Point({n, n}, rate, deviation));
  return points;
}

TEST(OneSequenceTest, GainFollowsTheRate) {
  // 16^(b - 1).
  EXPECT_NEAR(OneSequenceGain(Curve(256, 1.25, 0.01)), 2, 1e-6);
  EXPECT_NEAR(OneSequenceGain(Curve(4096, 1.5, 0.01)), 4, 1e-6);
}

TEST(OneSequenceTest, SmallGainsAreNotReported) {
  EXPECT_EQ(OneSequenceGain(Curve(256, 1.0, 0.001)), 0);
  EXPECT_EQ(OneSequenceGain(Curve(256, 1.03, 0.001)), 0);  // 1.087 times.
}

TEST(OneSequenceTest, InsignificantGainsAreNotReported) {
  // Over a growth of 8, the rate is known within 0.2 * sqrt(2) / log(8).
  EXPECT_EQ(OneSequenceGain(Curve(256, 1.2, 0.2)), 0);
  EXPECT_GT(OneSequenceGain(Curve(256, 1.2, 0.1)), 0);
}

TEST(OneSequenceTest, UsesTheLastPoints) {
  std::vector<RoundRecord> points = Curve(64, 1.9, 0.01);
  for (const uint64_t n : {128, 256, 512, 1024}) points.push_back(Point({n, n}, 1.25, 0.01));
  EXPECT_NEAR(OneSequenceGain(points), 2, 1e-6);
}

TEST(OneSequenceTest, UsesEarlyPointsIfNeeded) {
  const std::vector<RoundRecord> points{Point({16}, 1.25, 0.01), Point({200}, 1.25, 0.01),
                                        Point({256}, 1.25, 0.01)};
  EXPECT_NEAR(OneSequenceGain(points), 2, 1e-6);
}

TEST(OneSequenceTest, AccountsForCellsThatWereAhead) {
  // At the intermediate point one cell had all of its samples, and the other, with most of the
  // error, few.
  for (const double rate : {1.0, 1.25}) {
    const std::vector<RoundRecord> points{Point({256, 64}, rate, 0.01),
                                          Point({256, 256}, rate, 0.01)};
    EXPECT_NEAR(OneSequenceGain(points), rate == 1 ? 0 : 2, 1e-6) << rate;
  }
}

TEST(OneSequenceTest, NoRateFromFewerThanTwoPoints) {
  EXPECT_EQ(OneSequenceGain({}), 0);
  EXPECT_EQ(OneSequenceGain(Curve(16, 1.5, 0.01)), 0);
  EXPECT_EQ(OneSequenceGain(std::vector{Point({200}, 1.5, 0.01), Point({256}, 1.5, 0.01)}), 0);
  std::vector<RoundRecord> black = Curve(256, 1.5, 0.01);
  for (CellRound& cell : black.back().cells) cell.error.sum = 0;
  EXPECT_EQ(OneSequenceGain(black), 0);
  std::vector<RoundRecord> other = Curve(256, 1.5, 0.01);
  other.back().cells.pop_back();
  EXPECT_EQ(OneSequenceGain(other), 0);
}

}  // namespace
}  // namespace sheaf::coordinator
