// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/normal_distribution.h"

#include "gtest/gtest.h"

namespace sheaf {
namespace {

// Expected values: Abramowitz and Stegun 1964, Handbook of Mathematical Functions,
// tables 26.1, 26.2 and 26.5.
TEST(NormalDistributionTest, CdfMatchesTables) {
  EXPECT_DOUBLE_EQ(NormalCdf(0), 0.5);
  EXPECT_NEAR(NormalCdf(1), 0.841344746068543, 1e-15);
  EXPECT_NEAR(NormalCdf(-2), 0.022750131948179, 1e-15);
  // 1 minus the probability below 10 would be 0.
  EXPECT_NEAR(NormalCdf(-10) / 7.61985e-24, 1, 1e-6);
}

TEST(NormalDistributionTest, QuantilesMatchTables) {
  EXPECT_NEAR(NormalQuantile(0.975), 1.959963984540054, 1e-14);
  EXPECT_NEAR(NormalQuantile(0.1), -1.2815515655446004, 1e-14);
  EXPECT_NEAR(NormalQuantile(0.025), -1.959963984540054, 1e-14);
}

TEST(NormalDistributionTest, SmallQuantilesKeepPrecision) {
  for (const double deviations : {1.0, 5.0, 10.0, 30.0}) {
    EXPECT_NEAR(NormalQuantile(NormalCdf(-deviations)), -deviations, 1e-12);
  }
}

}  // namespace
}  // namespace sheaf
