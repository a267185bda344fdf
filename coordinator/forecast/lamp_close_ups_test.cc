// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/lamp_close_ups.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

namespace sheaf::coordinator {
namespace {

using testing::ElementsAre;

constexpr PixelRect kFrame{0, 0, 100, 80};
constexpr float kLamp = 500, kWall = 0.5F;

// A round emitter before a wall.
CloseUp CloseUpOf(double x, double y, double radius_px, const PixelRect& rect, int32_t scale = 4) {
  FilmOutputs outputs;
  outputs.AddLightPaths();
  CloseUp close_up{
      {rect, scale},
      MakeFramePicture({rect.x0 * scale, rect.y0 * scale, rect.x1 * scale, rect.y1 * scale},
                       kFrame.x1 * scale, kFrame.y1 * scale, outputs)};
  const PixelRect& window = close_up.picture.window;
  for (int32_t v = window.y0; v < window.y1; ++v) {
    for (int32_t u = window.x0; u < window.x1; ++u) {
      const bool is_lamp = std::hypot((u + 0.5) / scale - x, (v + 0.5) / scale - y) < radius_px;
      for (const std::string channel : {"R", "G", "B"}) {
        (*close_up.picture.Find(channel))[window.IndexOf(u, v)] = is_lamp ? kLamp : kWall;
        (*close_up.picture.Find("seen." + channel))[window.IndexOf(u, v)] = is_lamp ? kLamp : 0;
      }
    }
  }
  return close_up;
}

TEST(LampCloseUpsTest, SmallLampsComeFirstAsFarAsSamplesGo) {
  const std::vector<PixelRect> lamps = {
      {10, 10, 18, 17}, {50, 50, 51, 51}, {30, 30, 60, 60}, {-9, 0, -3, 2}, {99, 20, 101, 22}};
  // The third is large, the fourth is not in the window.
  const CloseUpPlace corner{{98, 19, 100, 23}, 4}, middle{{49, 49, 52, 52}, 4};
  const CloseUpPlace large{{9, 9, 19, 18}, 2};
  const double all = 16 * (8 + 9) + 4 * 90;
  EXPECT_THAT(ChooseCloseUps(lamps, kFrame, 8, all), ElementsAre(corner, middle, large));
  EXPECT_THAT(ChooseCloseUps(lamps, kFrame, 8, all - 1), ElementsAre(corner, middle));
}

// As those of the two triangles of a square.
TEST(LampCloseUpsTest, LampsSideBySideAreSeenOnce) {
  const std::vector<PixelRect> lamps = {{50, 50, 52, 52}, {50, 50, 52, 52}, {52, 50, 54, 52}};
  EXPECT_THAT(ChooseCloseUps(lamps, kFrame, 8, 1e9),
              ElementsAre(CloseUpPlace{{49, 49, 53, 53}, 4}));
}

TEST(LampCloseUpsTest, ThereAreNoMoreThanAFarmRendersSoon) {
  std::vector<PixelRect> lamps;
  for (int32_t i = 0; i < 100; ++i)
    lamps.push_back({8 * (i % 10), 8 * (i / 10), 8 * (i % 10) + 1, 8 * (i / 10) + 1});
  EXPECT_EQ(ChooseCloseUps(lamps, kFrame, 8, 1e9).size(), kCloseUpsMax);
}

// Filters add up to 1 over the pixels that see a point, so shares do to the emitter's area.
TEST(LampCloseUpsTest, SharesAddUpToTheLampsArea) {
  const double radius_px = 1.2;
  const CloseUp close_up = CloseUpOf(40.3, 30.6, radius_px, {38, 28, 43, 33});
  for (const auto kind : {FilterDescription::Kind::kBox, FilterDescription::Kind::kTriangle,
                          FilterDescription::Kind::kGaussian}) {
    FilterDescription filter;
    filter.kind = kind;
    if (kind == FilterDescription::Kind::kBox) filter.radius_x_px = filter.radius_y_px = 0.5F;
    double area = 0;
    for (const LampPixel& pixel : LampPixelsOf(close_up, filter, kFrame)) {
      area += pixel.share;
      EXPECT_LE(pixel.share, 1);
      EXPECT_DOUBLE_EQ(pixel.lamp[0], double{kLamp});
      EXPECT_DOUBLE_EQ(pixel.beside[2], double{kWall});
    }
    const double expected = std::numbers::pi * radius_px * radius_px;
    EXPECT_NEAR(area, expected, 0.1 * expected);
  }
}

TEST(LampCloseUpsTest, PixelsAreInTheWindow) {
  const CloseUp close_up = CloseUpOf(0.5, 79.5, 0.5, {0, 78, 2, 80});
  for (const LampPixel& pixel : LampPixelsOf(close_up, {}, kFrame)) {
    EXPECT_TRUE(pixel.x >= 0 && pixel.y < 80) << pixel.x << ' ' << pixel.y;
  }
}

TEST(LampCloseUpsTest, HiddenLampsHaveNoPixels) {
  EXPECT_TRUE(LampPixelsOf(CloseUpOf(40.3, 30.6, 0, {38, 28, 43, 33}), {}, kFrame).empty());
}

TEST(LampCloseUpsTest, WhereAllIsLampNothingIsBeside) {
  EXPECT_TRUE(LampPixelsOf(CloseUpOf(40.3, 30.6, 9, {38, 28, 43, 33}), {}, kFrame).empty());
}

}  // namespace
}  // namespace sheaf::coordinator
