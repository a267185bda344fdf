// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_prices.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sheaf::cli {
namespace {

StudyCurve MakePricedCurve() {
  StudyCurve curve;
  curve.points = {{16, 1, {0.16, 0.016}, false}, {64, 4, {0.02, 0.002}, false}};
  curve.rate = Estimate{1.5, 0.1};
  return curve;
}

TEST(StudyPricesTest, ErrorsAreInterpolatedAndExtrapolatedAlongTheRate) {
  const StudyCurve curve = MakePricedCurve();
  EXPECT_NEAR(ErrorAt(curve, 16)->value, 0.16, 1e-12);
  EXPECT_NEAR(ErrorAt(curve, 64)->value, 0.02, 1e-12);
  // Half way between them in logarithms.
  EXPECT_NEAR(ErrorAt(curve, 32)->value, std::sqrt(0.16 * 0.02), 1e-12);
  EXPECT_NEAR(ErrorAt(curve, 256)->value, 0.02 / 8, 1e-12);
  EXPECT_NEAR(ErrorAt(curve, 256)->error, 0.002 / 8, 1e-12);
  EXPECT_NEAR(ErrorAt(curve, 4)->value, 0.16 * 8, 1e-12);
}

TEST(StudyPricesTest, NothingIsKnownWithoutPoints) {
  EXPECT_FALSE(ErrorAt(StudyCurve(), 16));
  EXPECT_FALSE(ErrorAt(MakePricedCurve(), 0));
}

TEST(StudyPricesTest, WallTimeAndSamplesAreInverse) {
  const double seconds = WallSecondsOn(4, 380);
  EXPECT_NEAR(seconds, 100, 1e-9);
  EXPECT_NEAR(SamplesIn(seconds, 4, 3.8), 100, 1e-9);
  EXPECT_NEAR(SamplesIn(seconds, 4, 3.8, 190), 50, 1e-9);
  EXPECT_EQ(SamplesIn(seconds, 4, 3.8, 381), 0);
}

}  // namespace
}  // namespace sheaf::cli
