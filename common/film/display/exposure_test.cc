// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/display/exposure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "common/film/image_color.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

FrameImage GrayImage(const std::vector<float>& values) {
  FrameImage image;
  image.window = {0, 0, static_cast<int32_t>(values.size()), 1};
  image.channel_names = {"R", "G", "B"};
  image.planes.assign(3, values);
  return image;
}

TEST(ExposureTest, IsAutomaticOrANumberOfStops) {
  EXPECT_TRUE(ParseExposure("auto")->is_automatic);
  EXPECT_EQ(ParseExposure("")->stops, 0);
  EXPECT_FALSE(ParseExposure("")->is_automatic);
  EXPECT_EQ(ParseExposure("-9.5")->stops, -9.5);
  EXPECT_EQ(ParseExposure("+2")->stops, 2);
  for (const char* const wrong : {"bright", "65", "-65", "nan", "1 EV"}) {
    EXPECT_THAT(std::string(ParseExposure(wrong).status().message()),
                HasSubstr("expected \"auto\" or a number of stops from -64 to 64"))
        << wrong;
  }
}

// Half of the pixels has 1/4 and half 4 times the middle gray: their logarithmic average is it.
TEST(ExposureTest, TheLogarithmicAverageBecomesMiddleGray) {
  std::vector<float> values(100, 0.18f / 4);
  for (size_t i = 0; i < values.size(); i += 2) values[i] = 0.18f * 4;
  EXPECT_EQ(AutomaticStops(GrayImage(values)), 0);
  for (float& value : values) value *= 1 << 14;  // As candela do.
  EXPECT_NEAR(AutomaticStops(GrayImage(values)), -14, 1e-9);
  for (float& value : values) value /= 1 << 20;
  EXPECT_NEAR(AutomaticStops(GrayImage(values)), 6, 1e-9);
}

// Average: 0.18, but a tenth of the pixels has 8: these would be white.
TEST(ExposureTest, AtMostATwentiethOfThePixelsSaturates) {
  std::vector<float> values(1000, 0.01f);
  for (size_t i = 0; i < 100; ++i) values[i] = 8;
  EXPECT_NEAR(AutomaticStops(GrayImage(values)), -3, 1e-9);
  for (size_t i = 0; i < 60; ++i) values[i] = 0.01f;  // A twenty-fifth: the average counts.
  const double average = 0.04 * std::log2(8) + 0.96 * std::log2(0.01);
  EXPECT_NEAR(AutomaticStops(GrayImage(values)), std::log2(0.18) - average, 0.005);
}

TEST(ExposureTest, BlackAndNonFinitePixelsDoNotCount) {
  EXPECT_EQ(AutomaticStops(GrayImage({0, 0, -1})), 0);
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_NEAR(AutomaticStops(GrayImage({0, 0, 0.36f, 0.36f, infinity, std::nanf("")})), -1, 0.005);
}

// Luminance is that of the image's own primaries: green of Rec. 709 has 0.7152, that of ACES AP1
// 0.6741.
TEST(ExposureTest, LuminanceFollowsTheChromaticities) {
  FrameImage image = GrayImage({1, 1, 1, 1});
  image.planes[0] = image.planes[2] = {0, 0, 0, 0};
  EXPECT_NEAR(AutomaticStops(image), std::log2(0.18 / 0.7152), 0.005);
  image.color.chromaticities = ChromaticitiesOf(Primaries::kAcesCg);
  EXPECT_NEAR(AutomaticStops(image), std::log2(0.18 / 0.6741), 0.005);
}

}  // namespace
}  // namespace sheaf
