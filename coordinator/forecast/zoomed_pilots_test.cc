// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/zoomed_pilots.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

namespace sheaf::coordinator {
namespace {

using ::testing::ElementsAre;

constexpr PixelRect kZoomedFrame{0, 0, 100, 80};
constexpr float kBright = 500, kDim = 0.5F;

// A round emitter in front of a wall.
ZoomedPilot ZoomedPilotOf(double x, double y, double radius_px, const PixelRect& rect,
                          int32_t scale = 4) {
  FilmOutputs outputs;
  outputs.AddLightPaths();
  ZoomedPilot zoomed_pilot{
      {rect, scale},
      MakeFrameImage({rect.x0 * scale, rect.y0 * scale, rect.x1 * scale, rect.y1 * scale},
                     kZoomedFrame.x1 * scale, kZoomedFrame.y1 * scale, outputs)};
  const PixelRect& window = zoomed_pilot.image.window;
  for (int32_t v = window.y0; v < window.y1; ++v) {
    for (int32_t u = window.x0; u < window.x1; ++u) {
      const bool is_emitter = std::hypot((u + 0.5) / scale - x, (v + 0.5) / scale - y) < radius_px;
      for (const std::string channel : {"R", "G", "B"}) {
        (*zoomed_pilot.image.Find(channel))[window.IndexOf(u, v)] = is_emitter ? kBright : kDim;
        (*zoomed_pilot.image.Find("emission." + channel))[window.IndexOf(u, v)] =
            is_emitter ? kBright : 0;
      }
    }
  }
  return zoomed_pilot;
}

TEST(ZoomedPilotsTest, SmallestEmittersComeFirstWithinTheBudget) {
  const std::vector<PixelRect> emitters = {
      {10, 10, 18, 17}, {50, 50, 51, 51}, {30, 30, 60, 60}, {-9, 0, -3, 2}, {99, 20, 101, 22}};
  // The third is large, the fourth is not in the window.
  const ZoomedRegion corner{{98, 19, 100, 23}, 4}, middle{{49, 49, 52, 52}, 4};
  const ZoomedRegion large{{9, 9, 19, 18}, 2};
  const double all = 16 * (8 + 9) + 4 * 90;
  EXPECT_THAT(ChooseZoomedRegions(emitters, kZoomedFrame, 8, all),
              ElementsAre(corner, middle, large));
  EXPECT_THAT(ChooseZoomedRegions(emitters, kZoomedFrame, 8, all - 1), ElementsAre(corner, middle));
}

// Like the emitters of the two triangles of a square.
TEST(ZoomedPilotsTest, AdjacentEmittersShareARegion) {
  const std::vector<PixelRect> emitters = {{50, 50, 52, 52}, {50, 50, 52, 52}, {52, 50, 54, 52}};
  EXPECT_THAT(ChooseZoomedRegions(emitters, kZoomedFrame, 8, 1e9),
              ElementsAre(ZoomedRegion{{49, 49, 53, 53}, 4}));
}

TEST(ZoomedPilotsTest, RegionCountIsLimited) {
  std::vector<PixelRect> emitters;
  for (int32_t i = 0; i < 100; ++i)
    emitters.push_back({8 * (i % 10), 8 * (i / 10), 8 * (i % 10) + 1, 8 * (i / 10) + 1});
  EXPECT_EQ(ChooseZoomedRegions(emitters, kZoomedFrame, 8, 1e9).size(), kZoomedPilotsMax);
}

// The filters that reach a point add up to 1, so the fractions add up to the emitter's area.
TEST(ZoomedPilotsTest, FractionsSumToTheEmitterArea) {
  const double radius_px = 1.2;
  const ZoomedPilot zoomed_pilot = ZoomedPilotOf(40.3, 30.6, radius_px, {38, 28, 43, 33});
  for (const auto kind : {FilterDescription::Kind::kBox, FilterDescription::Kind::kTriangle,
                          FilterDescription::Kind::kGaussian}) {
    FilterDescription filter;
    filter.kind = kind;
    if (kind == FilterDescription::Kind::kBox) filter.radius_x_px = filter.radius_y_px = 0.5F;
    double area = 0;
    for (const EmitterPixel& pixel : EmitterPixelsOf(zoomed_pilot, filter, kZoomedFrame)) {
      area += pixel.fraction;
      EXPECT_LE(pixel.fraction, 1);
      EXPECT_DOUBLE_EQ(pixel.emitter[0], double{kBright});
      EXPECT_DOUBLE_EQ(pixel.beside[2], double{kDim});
    }
    const double expected = std::numbers::pi * radius_px * radius_px;
    EXPECT_NEAR(area, expected, 0.1 * expected);
  }
}

TEST(ZoomedPilotsTest, PixelsLieInTheWindow) {
  const ZoomedPilot zoomed_pilot = ZoomedPilotOf(0.5, 79.5, 0.5, {0, 78, 2, 80});
  for (const EmitterPixel& pixel : EmitterPixelsOf(zoomed_pilot, {}, kZoomedFrame)) {
    EXPECT_TRUE(pixel.x >= 0 && pixel.y < 80) << pixel.x << ' ' << pixel.y;
  }
}

TEST(ZoomedPilotsTest, HiddenEmittersHaveNoPixels) {
  EXPECT_TRUE(
      EmitterPixelsOf(ZoomedPilotOf(40.3, 30.6, 0, {38, 28, 43, 33}), {}, kZoomedFrame).empty());
}

TEST(ZoomedPilotsTest, NoPixelsWithoutABackground) {
  EXPECT_TRUE(
      EmitterPixelsOf(ZoomedPilotOf(40.3, 30.6, 9, {38, 28, 43, 33}), {}, kZoomedFrame).empty());
}

}  // namespace
}  // namespace sheaf::coordinator
