// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/lamp_rims.h"

#include <cmath>
#include <numbers>
#include <random>

#include "common/film/film.h"
#include "common/film/film_tile.h"
#include "common/scene/filter_value.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr int32_t kSidePx = 120, kShrink = 5, kTileSizePx = 60;
constexpr double kRadiusPx = 11.4, kLamp = 500, kWall = 0.5;

FilterDescription FilterOf(FilterDescription::Kind kind) {
  FilterDescription filter;
  filter.kind = kind;
  if (kind == FilterDescription::Kind::kBox) filter.radius_x_px = filter.radius_y_px = 0.5f;
  return filter;
}

// A round lamp before a wall, seen at a point of the frame, in pixels.
double Radiance(double x, double y) {
  return std::hypot(x - 58.3, y - 61.7) < kRadiusPx ? kLamp : kWall;
}

size_t TileOf(int32_t x, int32_t y) {
  return static_cast<size_t>(y / kTileSizePx * (kSidePx / kTileSizePx) + x / kTileSizePx);
}

double OffsetPx(const FilterDescription& filter, std::mt19937_64* random) {
  std::uniform_real_distribution<double> unit;
  while (true) {
    const double x = 2 * unit(*random) - 1;
    if (unit(*random) < FilterValue(filter, std::fabs(x), filter.radius_x_px)) {
      return x * filter.radius_x_px;
    }
  }
}

FramePicture Render(const FilterDescription& filter, uint64_t samples, uint64_t seed) {
  std::mt19937_64 random(seed);
  FilmTile tile({0, 0, kSidePx, kSidePx}, {0, samples});
  PixelAccumulator accumulator(&tile);
  for (int32_t y = 0; y < kSidePx; ++y) {
    for (int32_t x = 0; x < kSidePx; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t n = 0; n < samples; ++n) {
        const double value =
            Radiance(x + 0.5 + OffsetPx(filter, &random), y + 0.5 + OffsetPx(filter, &random));
        accumulator.Add(n, {.radiance = Rgb::Grey(static_cast<float>(value))});
      }
      accumulator.End();
    }
  }
  FramePicture picture = MakeFramePicture(tile.rect(), kSidePx, kSidePx);
  DevelopTile(tile, &picture);
  return picture;
}

FramePicture RenderSmall(uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  constexpr int32_t kSmallPx = kSidePx / kShrink;
  FilmOutputs outputs;
  outputs.AddLightPaths();
  FramePicture small = MakeFramePicture({0, 0, kSmallPx, kSmallPx}, kSmallPx, kSmallPx, outputs);
  for (int32_t p = 0; p < kSmallPx * kSmallPx; ++p) {
    const double x = p % kSmallPx + unit(random), y = p / kSmallPx + unit(random);
    const auto value = static_cast<float>(Radiance(kShrink * x, kShrink * y));
    for (const std::string channel : {"R", "G", "B"}) {
      (*small.Find(channel))[static_cast<size_t>(p)] = value;
      (*small.Find("seen." + channel))[static_cast<size_t>(p)] = value == kLamp ? value : 0;
    }
  }
  return small;
}

LampRims RimsOf(const FilterDescription& filter, uint64_t seed) {
  const double share = std::numbers::pi * kRadiusPx * kRadiusPx / kSidePx / kSidePx;
  return {RenderSmall(seed), kShrink, share * kLamp + (1 - share) * kWall, filter, TileOf};
}

TEST(LampRimsTest, LengthIsTheLampsOutline) {
  double length_px = 0;
  constexpr int kPictures = 20;
  for (uint64_t seed = 0; seed < kPictures; ++seed) {
    length_px += RimsOf({}, seed).LengthPx() / kPictures;
  }
  const double outline_px = 2 * std::numbers::pi * kRadiusPx;
  EXPECT_NEAR(length_px, outline_px, 0.15 * outline_px);
}

TEST(LampRimsTest, ThereAreNoneWhereNoLampIsMuchBrighterThanWhatIsBeside) {
  FramePicture small = RenderSmall(1);
  for (const std::string channel : {"R", "G", "B"}) {
    for (float& value : *small.Find(channel)) value = std::max(value, static_cast<float>(kLamp));
  }
  EXPECT_TRUE(LampRims(small, kShrink, kLamp, {}, TileOf).empty());
  for (const std::string channel : {"R", "G", "B"}) {
    for (float& value : *small.Find("seen." + channel)) value = 0;
  }
  EXPECT_TRUE(LampRims(small, kShrink, kLamp, {}, TileOf).empty());
}

// The widths that a box's shadow has, over directions: the mean of |cos| + |sin|, 4 / pi. Half of
// them see more lamp than wall.
TEST(LampRimsTest, SharesAreThoseOfAnEdgeAcrossTheFilter) {
  const FilterDescription box = FilterOf(FilterDescription::Kind::kBox);
  double width_px = 0, lamp_px = 0;
  for (const RimShare& share : SharesBeyondRims(box)) {
    EXPECT_GT(share.lamp, 0);
    EXPECT_LE(share.lamp, 1);
    width_px += share.width_px;
    lamp_px += share.width_px * share.lamp;
  }
  EXPECT_NEAR(width_px, 4 / std::numbers::pi, 0.03);
  EXPECT_NEAR(lamp_px, width_px / 2, 0.03);
}

// What is foreseen from a small picture against what pictures at full size turn out to say.
class LampRimsForesee : public testing::TestWithParam<FilterDescription::Kind> {};
TEST_P(LampRimsForesee, WhatTheBoundWillBe) {
  constexpr int kPictures = 6;
  const FilterDescription filter = FilterOf(GetParam());
  const std::vector<PixelRect> tiles = CutTiles({0, 0, kSidePx, kSidePx}, kTileSizePx);
  for (const uint64_t samples : {16, 64}) {
    double actual = 0, foreseen = 0;
    for (uint64_t seed = 1; seed <= uint64_t{kPictures}; ++seed) {
      ErrorSums sum;
      for (const ErrorSums& error : EstimateTileErrors(Render(filter, samples, seed), tiles)) {
        sum.Add(error);
      }
      actual += std::log(sum.Deviation());
      std::vector<ErrorSums> errors(tiles.size());
      for (size_t i = 0; i < tiles.size(); ++i) errors[i].pixel_count = tiles[i].PixelCount();
      const std::vector<uint64_t> all(tiles.size(), samples);
      RimsOf(filter, seed).AddErrors(all, 0, nullptr, &errors);
      ErrorSums of_rims;
      for (const ErrorSums& error : errors) of_rims.Add(error);
      foreseen += std::log(of_rims.Deviation());
    }
    EXPECT_NEAR((foreseen - actual) / kPictures, 0, std::log(1.5)) << samples;
  }
}
INSTANTIATE_TEST_SUITE_P(Filters, LampRimsForesee,
                         testing::Values(FilterDescription::Kind::kGaussian,
                                         FilterDescription::Kind::kTriangle,
                                         FilterDescription::Kind::kBox));

}  // namespace
}  // namespace sheaf::coordinator
