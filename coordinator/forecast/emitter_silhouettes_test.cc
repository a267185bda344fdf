// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/emitter_silhouettes.h"

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
constexpr double kRadiusPx = 11.4, kSmallRadiusPx = 0.7;
constexpr double kEmitterX = 58.3, kEmitterY = 61.7, kEmitter = 500, kWall = 0.5;

constexpr PixelRect kFrame{0, 0, kSidePx, kSidePx};

FilterDescription FilterOf(FilterDescription::Kind kind) {
  FilterDescription filter;
  filter.kind = kind;
  if (kind == FilterDescription::Kind::kBox) filter.radius_x_px = filter.radius_y_px = 0.5f;
  return filter;
}

// A round emitter in front of a wall, evaluated at a point of the frame, in pixels.
double Radiance(double x, double y, double radius_px) {
  return std::hypot(x - kEmitterX, y - kEmitterY) < radius_px ? kEmitter : kWall;
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

FrameImage Render(const FilterDescription& filter, double radius_px, uint64_t samples,
                  uint64_t seed) {
  std::mt19937_64 random(seed);
  FilmTile tile({0, 0, kSidePx, kSidePx}, {0, samples});
  PixelAccumulator accumulator(&tile);
  for (int32_t y = 0; y < kSidePx; ++y) {
    for (int32_t x = 0; x < kSidePx; ++x) {
      accumulator.Begin(x, y);
      const bool is_near = std::hypot(x - kEmitterX, y - kEmitterY) < radius_px + 4;
      for (uint64_t n = 0; n < samples; ++n) {
        const double value = !is_near ? kWall
                                      : Radiance(x + 0.5 + OffsetPx(filter, &random),
                                                 y + 0.5 + OffsetPx(filter, &random), radius_px);
        accumulator.Add(n, {.radiance = Rgb::Gray(static_cast<float>(value))});
      }
      accumulator.End();
    }
  }
  FrameImage image = MakeFrameImage(tile.rect(), kSidePx, kSidePx);
  DevelopTile(tile, &image);
  return image;
}

// An image with one sample per pixel of a window; its pixels have an edge of pixel_px pixels of the
// frame.
FrameImage RenderSeenLayer(const PixelRect& window, double pixel_px, double radius_px,
                           uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  FilmOutputs outputs;
  outputs.AddLightPaths();
  const auto side = static_cast<int32_t>(kSidePx / pixel_px);
  FrameImage seen = MakeFrameImage(window, side, side, outputs);
  for (int32_t y = window.y0; y < window.y1; ++y) {
    for (int32_t x = window.x0; x < window.x1; ++x) {
      const auto value = static_cast<float>(
          Radiance(pixel_px * (x + unit(random)), pixel_px * (y + unit(random)), radius_px));
      for (const std::string channel : {"R", "G", "B"}) {
        (*seen.Find(channel))[window.IndexOf(x, y)] = value;
        (*seen.Find("emission." + channel))[window.IndexOf(x, y)] = value == kEmitter ? value : 0;
      }
    }
  }
  return seen;
}
FrameImage RenderSmall(double radius_px, uint64_t seed) {
  return RenderSeenLayer({0, 0, kSidePx / kShrink, kSidePx / kShrink}, kShrink, radius_px, seed);
}

// Includes a zoomed pilot if the emitter is small.
EmitterSilhouettes SilhouettesOf(const FilterDescription& filter, double radius_px, uint64_t seed) {
  const double fraction = std::numbers::pi * radius_px * radius_px / kSidePx / kSidePx;
  std::vector<ZoomedPilot> zoomed_pilots;
  if (radius_px < kShrink) {
    constexpr int32_t kScale = kZoomedPilotScaleMax;
    const PixelRect rect{56, 60, 61, 64};
    const PixelRect window{rect.x0 * kScale, rect.y0 * kScale, rect.x1 * kScale, rect.y1 * kScale};
    zoomed_pilots.push_back(
        {{rect, kScale}, RenderSeenLayer(window, 1.0 / kScale, radius_px, seed)});
  }
  const double mean = fraction * kEmitter + (1 - fraction) * kWall;
  return {RenderSmall(radius_px, seed), kShrink, zoomed_pilots, mean, filter, kFrame, TileOf};
}

TEST(EmitterSilhouettesTest, LengthMatchesTheOutline) {
  double length_px = 0;
  constexpr int kImages = 20;
  for (uint64_t seed = 0; seed < kImages; ++seed) {
    length_px += SilhouettesOf({}, kRadiusPx, seed).LengthPx() / kImages;
  }
  const double outline_px = 2 * std::numbers::pi * kRadiusPx;
  EXPECT_NEAR(length_px, outline_px, 0.15 * outline_px);
}

TEST(EmitterSilhouettesTest, EmptyWithoutBrightEmitters) {
  FrameImage small = RenderSmall(kRadiusPx, 1);
  for (const std::string channel : {"R", "G", "B"}) {
    for (float& value : *small.Find(channel)) value = std::max(value, static_cast<float>(kEmitter));
  }
  EXPECT_TRUE(EmitterSilhouettes(small, kShrink, {}, kEmitter, {}, kFrame, TileOf).empty());
  for (const std::string channel : {"R", "G", "B"}) {
    for (float& value : *small.Find("emission." + channel)) value = 0;
  }
  EXPECT_TRUE(EmitterSilhouettes(small, kShrink, {}, kEmitter, {}, kFrame, TileOf).empty());
}

// The widths of a box's shadow, averaged over directions: the mean of |cos| + |sin|, 4 / pi. Half
// of the pixels contain more emitter than wall.
TEST(EmitterSilhouettesTest, FractionsMatchAnEdgeAcrossTheFilter) {
  const FilterDescription box = FilterOf(FilterDescription::Kind::kBox);
  double width_px = 0, emitter_px = 0;
  for (const SilhouetteFraction& fraction : FractionsBeyondSilhouettes(box)) {
    EXPECT_GT(fraction.emitter, 0);
    EXPECT_LE(fraction.emitter, 1);
    width_px += fraction.width_px;
    emitter_px += fraction.width_px * fraction.emitter;
  }
  EXPECT_NEAR(width_px, 4 / std::numbers::pi, 0.03);
  EXPECT_NEAR(emitter_px, width_px / 2, 0.03);
}

// Compares the forecast from few samples with images at full size.
struct ForeseenCase {
  FilterDescription::Kind filter;
  double radius_px;
};
class EmitterSilhouettesForecast : public ::testing::TestWithParam<ForeseenCase> {};
TEST_P(EmitterSilhouettesForecast, PredictsTheErrorBound) {
  constexpr uint64_t kImages = 25;
  const FilterDescription filter = FilterOf(GetParam().filter);
  const double radius_px = GetParam().radius_px;
  const std::vector<PixelRect> tiles = CutTiles(kFrame, kTileSizePx);
  const auto deviation_of = [](const std::vector<ErrorSums>& errors) {
    ErrorSums sum;
    for (const ErrorSums& error : errors) sum.Add(error);
    return sum.Deviation();
  };
  for (const uint64_t samples : {16, 64}) {
    double actual = 0, foreseen = 0;
    for (uint64_t seed = 1; seed <= kImages; ++seed) {
      actual += deviation_of(EstimateTileErrors(Render(filter, radius_px, samples, seed), tiles));
      std::vector<ErrorSums> errors(tiles.size());
      for (size_t i = 0; i < tiles.size(); ++i) errors[i].pixel_count = tiles[i].PixelCount();
      const std::vector<uint64_t> all(tiles.size(), samples);
      std::mt19937_64 random(seed);
      SilhouettesOf(filter, radius_px, seed).AddErrors(all, 0, &random, &errors);
      foreseen += deviation_of(errors);
    }
    EXPECT_NEAR(std::log(foreseen / actual), 0, std::log(1.5)) << samples;
  }
}
INSTANTIATE_TEST_SUITE_P(
    Emitters, EmitterSilhouettesForecast,
    ::testing::Values(ForeseenCase{FilterDescription::Kind::kGaussian, kRadiusPx},
                      ForeseenCase{FilterDescription::Kind::kTriangle, kRadiusPx},
                      ForeseenCase{FilterDescription::Kind::kBox, kRadiusPx},
                      ForeseenCase{FilterDescription::Kind::kGaussian, kSmallRadiusPx},
                      ForeseenCase{FilterDescription::Kind::kTriangle, kSmallRadiusPx}));

}  // namespace
}  // namespace sheaf::coordinator
