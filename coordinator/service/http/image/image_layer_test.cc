// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/image/image_layer.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "coordinator/service/http/image/false_color.h"
#include "gtest/gtest.h"
#include "tests/support/farm/http_fake_farm.h"

namespace sheaf::coordinator {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(FalseColorTest, FollowsViridis) {
  // Ten evenly spaced colors of matplotlib's map.
  constexpr Rgb8 kColors[] = {{68, 1, 84},    {72, 40, 120},  {62, 74, 137},  {49, 104, 142},
                              {38, 130, 142}, {31, 158, 137}, {53, 183, 121}, {109, 205, 89},
                              {180, 222, 44}, {253, 231, 37}};
  for (int i = 0; i < 10; ++i) {
    const Rgb8 color = Viridis(i / 9.0);
    EXPECT_LE(std::abs(color.r - kColors[i].r), 4) << i;
    EXPECT_LE(std::abs(color.g - kColors[i].g), 4) << i;
    EXPECT_LE(std::abs(color.b - kColors[i].b), 4) << i;
  }
  EXPECT_EQ(Viridis(-3), Viridis(0));
  EXPECT_EQ(Viridis(3), Viridis(1));
  EXPECT_EQ(Viridis(double{kNan}), Viridis(0));
}

TEST(ImageLayerTest, LayersHaveNames) {
  EXPECT_EQ(ImageLayerFromName(""), ImageLayer::kImage);
  EXPECT_EQ(ImageLayerFromName("image"), ImageLayer::kImage);
  EXPECT_EQ(ImageLayerFromName("light"), ImageLayer::kLight);
  EXPECT_EQ(ImageLayerFromName("error"), ImageLayer::kError);
  EXPECT_EQ(ImageLayerFromName("samples"), ImageLayer::kSamples);
  EXPECT_FALSE(ImageLayerFromName("Image").has_value());
}

TEST(ImageLayerTest, ImageAppliesTheSrgbCurveAndClamps) {
  FrameImage image = MakeFakeImage(4, 1, 0);
  image.planes[0] = {0.0f, 0.2158605f, 1.0f, 7.0f};
  image.planes[1] = {-1.0f, kNan, 0.5f, 0.001f};
  const auto display = MakeDisplayImage(image, ImageLayer::kImage);
  ASSERT_TRUE(display.ok());
  EXPECT_EQ(display->pixels[0], (Rgb8{0, 0, 0}));
  EXPECT_EQ(display->pixels[1], (Rgb8{128, 0, 0}));  // 0.21586 in light is level 128.
  EXPECT_EQ(display->pixels[2], (Rgb8{255, 188, 0}));
  EXPECT_EQ(display->pixels[3], (Rgb8{255, 3, 0}));
  EXPECT_FALSE(display->range.has_value());
}

TEST(ImageLayerTest, LargeImagesAreShrunkToTheLimit) {
  const FrameImage image = MakeFakeImage(2048, 2048, 1);
  const auto display = MakeDisplayImage(image, ImageLayer::kImage);
  ASSERT_TRUE(display.ok());
  EXPECT_EQ(display->width_px, 1024);
  EXPECT_EQ(display->height_px, 1024);
  EXPECT_EQ(display->pixels.size(), size_t{1024} * 1024);
  EXPECT_EQ(display->pixels.back(), (Rgb8{255, 255, 255}));
}

TEST(ImageLayerTest, LightKeepsItsRange) {
  const float inf = std::numeric_limits<float>::infinity();
  FrameImage image = MakeFakeImage(7, 1, 0);
  image.planes[0] = {0, 1, 1000, 3e-5f, -2, inf, 0.99999f};
  image.planes[1] = {0, 0.5f, 1, 1e-5f, kNan, 0, 0};
  image.planes[2] = {0, 0.25f, 500, 0, 0.125f, 0, 1e-30f};
  const auto display = MakeDisplayImage(image, ImageLayer::kLight);
  ASSERT_TRUE(display.ok());
  ASSERT_EQ(display->height_px, 2);
  ASSERT_EQ(display->pixels.size(), 14u);
  for (size_t x = 0; x < 7; ++x) {
    const Rgb8 mantissa = display->pixels[x], exponent = display->pixels[7 + x];
    EXPECT_EQ(exponent, (Rgb8{exponent.r, exponent.r, exponent.r}));
    const double unit = std::ldexp(1.0, exponent.r - 136);
    const double levels[] = {double(mantissa.r), double(mantissa.g), double(mantissa.b)};
    double largest = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double value = image.planes[c][x];
      largest = std::max(largest, std::isfinite(value) ? value : 0);
    }
    for (size_t c = 0; c < 3; ++c) {
      const double value = image.planes[c][x];
      if (std::isinf(value)) continue;
      const double shown = exponent.r == 0 ? 0 : levels[c] * unit;
      EXPECT_NEAR(shown, value > 0 ? value : 0, largest / 128) << x << " " << c;
    }
  }
  EXPECT_EQ(display->pixels[5].r, 128);  // Infinite: shown as the largest value.
  EXPECT_EQ(display->pixels[7 + 5].r, 255);
}

TEST(ImageLayerTest, ErrorIsRelativeOnALogarithmicScale) {
  FrameImage image = MakeFakeImage(100, 1, 1);
  // Errors from 1 % to 10 %, one pixel far beyond, and one without samples.
  for (size_t c = 3; c < 6; ++c) {
    for (size_t x = 0; x < 100; ++x) {
      image.planes[c][x] = 0.0101f * std::pow(10.0f, 0.0098f * static_cast<float>(x));
    }
    image.planes[c][99] = 40;
  }
  image.planes[6][98] = 0;
  const auto display = MakeDisplayImage(image, ImageLayer::kError);
  ASSERT_TRUE(display.ok());
  ASSERT_TRUE(display->range.has_value());
  EXPECT_NEAR(display->range->low, 0.01, 1e-9);
  EXPECT_NEAR(display->range->high, 0.1, 1e-9);
  EXPECT_EQ(display->pixels[98], kUnknownColor);
  EXPECT_EQ(display->pixels[99], Viridis(1));
  const double error = 0.0101 * std::pow(10.0, 0.0098 * 50) / std::sqrt(1 + 0.01);
  const Rgb8 expected = Viridis(std::log10(error / 0.01));
  EXPECT_LE(std::abs(display->pixels[50].g - expected.g), 1);
}

TEST(ImageLayerTest, ErrorNeedsTwoReplicates) {
  FrameImage image = MakeFakeImage(2, 1, 1);
  for (size_t c = 3; c < 6; ++c) image.planes[c] = {0, 0};
  const auto display = MakeDisplayImage(image, ImageLayer::kError);
  ASSERT_TRUE(display.ok());
  EXPECT_EQ(display->range, LayerRange());
  EXPECT_EQ(display->pixels[0], kUnknownColor);
}

TEST(ImageLayerTest, SamplesSpanTheirOwnRange) {
  FrameImage image = MakeFakeImage(4, 1, 1);
  image.planes[6] = {0, 16, 40, 64};
  const auto display = MakeDisplayImage(image, ImageLayer::kSamples);
  ASSERT_TRUE(display.ok());
  EXPECT_EQ(display->range, (LayerRange{16, 64}));
  EXPECT_EQ(display->pixels[0], kUnknownColor);
  EXPECT_EQ(display->pixels[1], Viridis(0));
  EXPECT_EQ(display->pixels[2], Viridis(0.5));
  EXPECT_EQ(display->pixels[3], Viridis(1));
}

TEST(ImageLayerTest, MissingChannelsAreErrors) {
  FrameImage image = MakeFakeImage(1, 1, 1);
  image.channel_names[6] = "other";
  EXPECT_TRUE(MakeDisplayImage(image, ImageLayer::kImage).ok());
  EXPECT_FALSE(MakeDisplayImage(image, ImageLayer::kError).ok());
  EXPECT_FALSE(MakeDisplayImage(image, ImageLayer::kSamples).ok());
}

TEST(ImageLayerTest, TimeIsPerTileAndGrayWhereUnknown) {
  FrameImage image;
  image.window = {0, 0, 4, 1};
  image.channel_names = {"cpu"};
  image.planes = {{0.001f, 0.001f, 0.01f, 0}};
  const auto display = MakeDisplayImage(image, ImageLayer::kTime);
  ASSERT_TRUE(display.ok()) << display.status();
  EXPECT_EQ(display->pixels[0], display->pixels[1]);
  EXPECT_NE(display->pixels[0], display->pixels[2]);
  EXPECT_EQ(display->pixels[3], kUnknownColor);
  EXPECT_DOUBLE_EQ(display->range->low, 0.001);
}

}  // namespace
}  // namespace sheaf::coordinator
