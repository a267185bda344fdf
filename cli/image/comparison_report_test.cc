// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/image/comparison_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

ComparisonReport Differing(double relative_mse) {
  ComparisonReport report;
  report.comparison.relative_mse = relative_mse;
  report.comparison.fraction_differing = 0.98765;
  report.comparison.reference_mean = 0.5;
  report.comparison.image_mean = 0.51;
  report.comparison.mean_ratio = {1.01, 1.02, 1.03};
  report.flip = 0.0123456789;
  report.noise = ExpectedNoise{0.01, 0.001};
  report.reference_digest = "aaaa";
  report.image_digest = "bbbb";
  return report;
}

TEST(ComparisonReportTest, VerdictComparesErrorWithErrorBars) {
  EXPECT_STREQ(VerdictOf(Differing(0.0129)), "within noise");
  EXPECT_STREQ(VerdictOf(Differing(0.0131)), "beyond noise");
  EXPECT_THAT(FormatComparison(Differing(0.03)),
              HasSubstr("beyond noise: the error bars predict a relMSE of 0.01 +- 0.001, and "
                        "relMSE is 3.0 times that; --tiles shows where"));
  ComparisonReport same = Differing(0);
  same.comparison.fraction_differing = 0;
  EXPECT_STREQ(VerdictOf(same), "identical");
  ComparisonReport unknown = Differing(0.01);
  unknown.noise.reset();
  EXPECT_STREQ(VerdictOf(unknown), "unknown");
}

TEST(ComparisonReportTest, NumbersAreRoundedWithUnits) {
  const std::string text = FormatComparison(Differing(0.0123456789));
  EXPECT_THAT(text, HasSubstr("relMSE               0.0123 (typical error of a pixel: 11 %)\n"));
  EXPECT_THAT(text,
              HasSubstr("FLIP                 0.0123 (0: no visible difference, 1: largest)\n"));
  EXPECT_THAT(text, HasSubstr("mean                 0.51, reference 0.5: +2 % (R +1 %, G +2 %, "
                              "B +3 %)\n"));
  EXPECT_THAT(text, HasSubstr("pixels that differ   98.77 %\n"));
  EXPECT_THAT(text, Not(HasSubstr("_")));
}

TEST(ComparisonReportTest, ReportsTilesAndTolerance) {
  ComparisonReport report = Differing(0.02);
  report.tolerance = 0.001;
  report.tiles = TileDeviations{64, 1, {{{16, 0, 32, 16}, 0, 0.51, 0.4, 0.01, 7.25}}};
  report.tiles->worst.push_back(report.tiles->worst[0]);
  report.tiles->worst[1].excess = std::numeric_limits<double>::infinity();
  const std::string text = FormatComparison(report);
  EXPECT_THAT(text, HasSubstr("1 of 64 differ by more than noise\n"));
  EXPECT_THAT(text, HasSubstr("[16, 32) x [0, 16)  R 0.51, reference 0.4, +7.2 standard errors "));
  EXPECT_THAT(text, HasSubstr("reference 0.4, without noise\n"));
  EXPECT_THAT(text, HasSubstr("relMSE is above 0.001\n"));
  EXPECT_THAT(text, Not(HasSubstr("inf")));
}

TEST(ComparisonReportTest, NoiseCombinesBothImages) {
  const ExpectedNoise a{0.03, 0.003}, b{0.01, 0.004};
  const std::optional<ExpectedNoise> both = NoiseOfDifference(a, b);
  ASSERT_TRUE(both);
  EXPECT_DOUBLE_EQ(both->relative_mse, 0.04);
  EXPECT_DOUBLE_EQ(both->deviation, 0.005);
  EXPECT_DOUBLE_EQ(NoiseOfDifference(std::nullopt, b)->relative_mse, 0.01);
  EXPECT_FALSE(NoiseOfDifference(a, std::nullopt));
}

TEST(ComparisonReportTest, OneSequenceHasNoErrorBars) {
  FrameImage image;
  image.window = {0, 0, 2, 1};
  image.frame_width_px = 2;
  image.frame_height_px = 1;
  image.channel_names = {"R", "G", "B", "stderr.R", "stderr.G", "stderr.B", "samples", "nonfinite"};
  image.planes = {{1, 1}, {1, 1}, {1, 1}, {.1f, .1f}, {.1f, .1f}, {.1f, .1f}, {16, 16}, {0, 0}};
  ASSERT_TRUE(NoiseOf(image));
  EXPECT_NEAR(NoiseOf(image)->relative_mse, 0.01, 0.002);
  image.metadata["sampling"] = "one-sequence";
  EXPECT_FALSE(NoiseOf(image));
  image.metadata.clear();
  image.channel_names[3] = "other";
  EXPECT_FALSE(NoiseOf(image));
}

}  // namespace
}  // namespace sheaf::cli
