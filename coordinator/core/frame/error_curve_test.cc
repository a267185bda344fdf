// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/error_curve.h"

#include <gtest/gtest.h>

namespace sheaf::coordinator {
namespace {

TEST(ErrorCurveTest, RoundTrips) {
  RoundRecord first, second;
  first.sample_count = 1600;
  first.relative_mse = 0.25;
  first.relative_mse_upper = 0.375;
  second.sample_count = 4650;
  second.relative_mse = 1e-7;
  second.relative_mse_upper = 1.5e-7;
  const std::vector<RoundRecord> rounds = {first, second};
  const std::string text = FormatErrorCurve(rounds, 100);
  EXPECT_EQ(text, "16 0.25 0.375, 46.5 1e-07 1.5e-07");
  const std::vector<ErrorPoint> points = ParseErrorCurve(text);
  ASSERT_EQ(points.size(), 2u);
  EXPECT_EQ(points[0].samples, 16);
  EXPECT_EQ(points[0].relative_mse, 0.25);
  EXPECT_EQ(points[0].relative_mse_upper, 0.375);
  EXPECT_EQ(points[1].samples, 46.5);
  EXPECT_EQ(points[1].relative_mse, 1e-7);
}

TEST(ErrorCurveTest, RefusesOtherText) {
  for (const char* text :
       {"", "16", "16 0.25", "16 0.25 0.375,", "16 a 0.375", "16 0.25 0.375 1"}) {
    EXPECT_TRUE(ParseErrorCurve(text).empty()) << text;
  }
  EXPECT_EQ(FormatErrorCurve({}, 100), "");
}

}  // namespace
}  // namespace sheaf::coordinator
