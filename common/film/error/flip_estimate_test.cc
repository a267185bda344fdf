// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/flip_estimate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/film/error/compare.h"
#include "common/film/film.h"
#include "common/film/film_test_samples.h"

namespace sheaf {
namespace {

constexpr PixelRect kFlipWindow{4, 2, 68, 66};

float Truth(int32_t x, int32_t y) {
  return 0.2f + 0.3f * static_cast<float>((x / 16 + y / 16) % 2);
}

// A noisy image of Truth, with the sample of its error, developed in tiles of 32.
struct Noisy {
  FrameImage image = MakeFrameImage(kFlipWindow, 80, 80);
  ErrorSample error{kFlipWindow};
};
Noisy MakeNoisy(uint64_t samples, float weight, const ImageColor& color = {}) {
  Noisy noisy;
  noisy.image = MakeFrameImage(kFlipWindow, 80, 80, {}, color);
  for (const PixelRect& rect : CutTiles(kFlipWindow, 32)) {
    FilmTile tile(rect, {0, samples});
    PixelAccumulator accumulator(&tile);
    for (int32_t y = rect.y0; y < rect.y1; ++y) {
      for (int32_t x = rect.x0; x < rect.x1; ++x) {
        accumulator.Begin(x, y);
        for (uint64_t n = 0; n < samples; ++n) {
          const auto key = static_cast<uint64_t>(x + 100 * y) * 4096 + n;
          const float light = Truth(x, y) * 2 * HashToUnit(key);
          accumulator.Add(n, {.radiance = {light, light, light}, .filter_weight = weight});
        }
        accumulator.End();
      }
    }
    DevelopTile(tile, &noisy.image);
    noisy.error.DevelopTile(tile, noisy.image.color);
  }
  return noisy;
}

double TrueFlip(const FrameImage& image) {
  FrameImage truth = image;
  for (const char* channel : {"R", "G", "B"}) {
    size_t p = 0;
    for (int32_t y = kFlipWindow.y0; y < kFlipWindow.y1; ++y) {
      for (int32_t x = kFlipWindow.x0; x < kFlipWindow.x1; ++x)
        (*truth.Find(channel))[p++] = Truth(x, y);
    }
  }
  return *PerceivedDifference(truth, image, FlipRange::kScreen);
}

TEST(FlipEstimateTest, PredictsFlipAgainstAReference) {
  for (const uint64_t samples : {16u, 64u, 256u}) {
    const Noisy noisy = MakeNoisy(samples, 1.5f);
    const std::optional<double> estimate = EstimateFlip(noisy.image, noisy.error);
    ASSERT_TRUE(estimate);
    const double truth = TrueFlip(noisy.image);
    EXPECT_GT(truth, 0.01);
    EXPECT_NEAR(*estimate / truth, 0.95, 0.1) << samples;
  }
}

TEST(FlipEstimateTest, ErrorSamplesHaveTheErrorVariance) {
  for (const uint64_t samples : {2u, 4u, 16u, 64u}) {
    const Noisy noisy = MakeNoisy(samples, 2);
    double squares = 0, variance = 0;
    size_t p = 0;
    for (int32_t y = kFlipWindow.y0; y < kFlipWindow.y1; ++y) {
      for (int32_t x = kFlipWindow.x0; x < kFlipWindow.x1; ++x, ++p) {
        squares += std::pow(double{noisy.error.planes()[1][p]}, 2);
        variance += std::pow(double{Truth(x, y)}, 2) / 3 / static_cast<double>(samples);
      }
    }
    EXPECT_NEAR(squares / variance, 1, 0.1) << samples;
  }
}

TEST(FlipEstimateTest, IndependentOfPrimaries) {
  ImageColor color;
  color.chromaticities = ChromaticitiesOf(Primaries::kRec2020);
  color.light_from_srgb = *RgbFromRgb(color.chromaticities, Chromaticities());
  const Noisy plain = MakeNoisy(16, 1), wide = MakeNoisy(16, 1, color);
  EXPECT_NEAR(*EstimateFlip(wide.image, wide.error), *EstimateFlip(plain.image, plain.error), 1e-4);
}

TEST(FlipEstimateTest, UnknownFromOneSample) {
  const Noisy noisy = MakeNoisy(1, 1);
  EXPECT_FALSE(EstimateFlip(noisy.image, noisy.error));
}

}  // namespace
}  // namespace sheaf
