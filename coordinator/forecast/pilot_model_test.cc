// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/pilot_model.h"

#include <cmath>
#include <random>

#include "coordinator/forecast/pilot_cost.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr PixelRect kWindow{0, 0, 320, 256};
constexpr int32_t kPilotTileSizePx = 32;

// The small image of a frame, with this mean.
PilotImage MakeSmall(const PilotLevel& level, float mean) {
  const int32_t width = kWindow.x1 / level.shrink, height = kWindow.y1 / level.shrink;
  FilmOutputs outputs;
  outputs.AddLightPaths();
  PilotImage pilot{level, MakeFrameImage({0, 0, width, height}, width, height, outputs), {}};
  for (const char* channel : {"R", "G", "B", "samples"}) {
    for (float& value : *pilot.image.Find(channel)) value = *channel == 's' ? 1 : mean;
  }
  return pilot;
}

// Pixels have the value 1 and the variance `variance` at 16 samples. Variances fall as 1 / n^rate
// above 16 samples and as 1 / n below, and are estimated with 15 degrees of freedom.
template <typename Variance>
PilotImage MakePilot(const PilotLevel& level, double rate, uint64_t seed,
                     const Variance& variance) {
  PilotImage pilot{level, MakeFrameImage(kWindow, kWindow.x1, kWindow.y1), {}};
  std::mt19937_64 random(seed);
  std::chi_squared_distribution<double> chi_squared(15);
  size_t p = 0;
  for (int32_t y = 0; y < kWindow.y1; ++y) {
    for (int32_t x = 0; x < kWindow.x1; ++x, ++p) {
      const SampleBlock samples =
          level.lattice.SamplesOf(level.lattice.PartOf(x, y), {0, level.samples});
      if (samples.count == 0) continue;
      const double growth = static_cast<double>(samples.count) / 16;
      const double v =
          variance(x, y) * std::pow(growth, growth < 1 ? -1 : -rate) * chi_squared(random) / 15;
      (*pilot.image.Find("samples"))[p] = static_cast<float>(samples.count);
      for (const char* channel : {"R", "G", "B"}) (*pilot.image.Find(channel))[p] = 1;
      for (const char* channel : {"stderr.R", "stderr.G", "stderr.B"}) {
        (*pilot.image.Find(channel))[p] = static_cast<float>(std::sqrt(v));
      }
    }
  }
  for (const PixelRect& tile : CutTiles(kWindow, kPilotTileSizePx)) {
    // 10 us per sample, more for an isolated one, and 1 ms per part.
    pilot.cpu_seconds_of_tiles.push_back(
        1e-3 +
        1e-5 * kSparseCost * static_cast<double>(level.lattice.SampleCountIn(tile, level.samples)));
  }
  return pilot;
}

template <typename Variance>
ErrorModel FitOf(double rate, const Variance& variance, double samples_per_pixel = 0.5,
                 float mean = 1) {
  std::vector<PilotImage> pilot;
  uint64_t seed = 1;
  for (const PilotLevel& level : PilotLevels(samples_per_pixel, kWindow.PixelCount(), 1, {})) {
    pilot.push_back(level.shrink > 1 ? MakeSmall(level, mean)
                                     : MakePilot(level, rate, ++seed, variance));
  }
  return FitErrorModel({kWindow, kPilotTileSizePx, kPilotTileSizePx}, pilot, {}, {});
}

TEST(PilotModelTest, PilotsStayWithinTheirBudget) {
  for (const int64_t pixels : {int64_t{1000}, int64_t{192 * 192}, int64_t{3840 * 2160}}) {
    for (const double allowed : {0.4, 2.0, 20.0}) {
      double cost = 0;
      for (const PilotLevel& level : PilotLevels(allowed, pixels, 1, {})) {
        cost += level.SamplesPerPixel();
      }
      EXPECT_LE(cost, allowed);
      if (pixels < 100'000 && allowed < 4) {
        EXPECT_GT(cost, 0.5 * allowed);
      }
    }
  }
}

TEST(PilotModelTest, FurtherPilotsUseNewBlocks) {
  std::vector<PilotLevel> before = PilotLevels(0.4, 400 * 400, 1, {});
  EXPECT_GT(before.front().shrink, 1);
  for (int i = 0; i < 12; ++i) {
    const std::vector<PilotLevel> more = PilotLevels(0.4 * std::pow(2, i), 400 * 400, 1, before);
    if (more.empty()) return;
    for (const PilotLevel& level : more) {
      EXPECT_EQ(level.shrink, 1);
      for (const PilotLevel& other : before) {
        EXPECT_FALSE(level.lattice.stride_px == other.lattice.stride_px &&
                     level.samples == other.samples);
      }
    }
    before.insert(before.end(), more.begin(), more.end());
  }
  FAIL() << "there are at most as many blocks as in the image";
}

TEST(PilotModelTest, LightImagesStayWithinTheirBudget) {
  for (const int64_t pixels : {int64_t{192 * 192}, int64_t{3840 * 2160}}) {
    for (const double per_pixel : {1.0, 4.0}) {
      double paths = 0;
      int light_count = 0;
      const std::vector<PilotLevel> levels = PilotLevels(0.4, pixels, 1, {}, {per_pixel});
      for (const PilotLevel& level : levels) {
        paths += level.SamplesPerPixel();
        if (level.lattice.All()) paths += per_pixel * level.SamplesPerPixel();
        light_count += level.is_light_image ? 1 : 0;
      }
      EXPECT_EQ(light_count, 1);
      EXPECT_TRUE(levels.back().is_light_image);
      EXPECT_LE(paths, 0.4 * (1 + per_pixel));
      // A second light image is larger, or there is none.
      const std::vector<PilotLevel> more = PilotLevels(2, pixels, 1, levels, {per_pixel});
      if (pixels < 100'000) {
        ASSERT_FALSE(more.empty());
        EXPECT_TRUE(more.back().is_light_image);
        EXPECT_LT(more.back().shrink, levels.back().shrink);
      } else {
        EXPECT_TRUE(more.empty() || !more.back().is_light_image);
      }
    }
  }
}

// Each image of a lattice costs a training.
TEST(PilotModelTest, GuidedPilotsHaveOneLattice) {
  const std::vector<PilotLevel> levels = PilotLevels(8, 1920 * 1080, 1, {}, {0, true});
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_GT(levels[0].shrink, 1);
  EXPECT_EQ(levels[1].samples, kPilotSamples);
  EXPECT_GT(PilotLevels(8, 1920 * 1080, 1, {}).size(), 2u);
}

TEST(PilotModelTest, FitsErrorRateAndCost) {
  for (const double rate : {1.0, 1.25}) {
    // A pilot of this size spends a part of its samples on a pair.
    const ErrorModel model = FitOf(
        rate, [](int32_t, int32_t) { return 0.04; }, 8);
    EXPECT_NEAR(model.rate, rate, 3 * model.rate_deviation);
    EXPECT_LT(model.rate_deviation, 0.05);
    // 0.04 / (1 + 0.1^2) at 16 samples.
    EXPECT_NEAR(ForecastSamples(model, 16).relative_mse, 0.0396, 3 * 0.0396 * 0.05);
    // Excludes the overhead of parts.
    EXPECT_NEAR(ForecastSamples(model, 100).cpu_seconds / (1e-3 * 320 * 256), 1, 0.1);
  }
  // A small pilot has no pair.
  EXPECT_GT(FitOf(
                1.0, [](int32_t, int32_t) { return 0.04; }, 0.4)
                .rate_deviation,
            0.05);
}

// A pilot of a small frame has no pair, and the overhead of its parts is a fifth of its cost.
TEST(PilotModelTest, FitsThePerTileCost) {
  const ErrorModel model = FitOf(
      1, [](int32_t, int32_t) { return 0.04; }, 0.4);
  EXPECT_NEAR(ForecastSamples(model, 100).cpu_seconds / (1e-3 * 320 * 256), 1, 0.05);
}

// The mean of a few unequal blocks is usually below the true mean, but quotes must not be.
TEST(PilotModelTest, QuotesAreMedianUnbiased) {
  int low = 0;
  constexpr int kFrames = 200;
  for (int frame = 0; frame < kFrames; ++frame) {
    std::mt19937_64 random(static_cast<uint64_t>(frame));
    std::lognormal_distribution<double> distribution(-0.5 * 1.6 * 1.6, 1.6);  // Its mean is 1.
    std::vector<double> of_places;
    for (int i = 0; i < 40 * 32; ++i) of_places.push_back(distribution(random));
    const ErrorModel model = FitOf(
        1,
        [&](int32_t x, int32_t y) {
          return 0.04 * of_places[static_cast<size_t>(y / 8 * 40 + x / 8)];
        },
        0.04);
    double mean = 0;
    for (const double place : of_places) mean += place / static_cast<double>(of_places.size());
    if (ForecastSamples(model, 16).relative_mse < 0.0396 * mean) ++low;
  }
  EXPECT_NEAR(low, kFrames / 2, 20);
}

// An emitter that is in no block makes the frame's mean ten times that of the blocks. The
// denominator of dark pixels' errors includes a tenth of the frame's mean: it is 1 + 1^2 instead of
// 1 + 0.1^2.
TEST(PilotModelTest, DarkPixelsUseTheFrameMean) {
  const auto error = [](float mean) {
    const ErrorModel model = FitOf(
        1, [](int32_t, int32_t) { return 0.04; }, 0.5, mean);
    return ForecastSamples(model, 16).relative_mse;
  };
  EXPECT_NEAR(error(10) / error(1), 1.01 / 2, 0.1);
}

// Compares images that differ only in the source of their light: visible emitters, or bright walls.
TEST(PilotModelTest, EmitterSilhouettesRaiseTheCost) {
  const auto variance = [](int32_t, int32_t) { return 0.01; };
  std::vector<PilotImage> pilot;
  uint64_t seed = 1;
  for (const PilotLevel& level : PilotLevels(0.5, kWindow.PixelCount(), 1, {})) {
    pilot.push_back(level.shrink > 1 ? MakeSmall(level, 0.2F)
                                     : MakePilot(level, 1, ++seed, variance));
  }
  FrameImage& small = pilot.front().image;
  std::vector<double> samples;
  for (const float seen : {0.0F, 500.0F}) {
    for (const char* channel : {"R", "G", "B"}) {
      for (int32_t y = 3; y < 9; ++y) {
        const size_t p = small.window.IndexOf(7, y);
        (*small.Find(channel))[p] = 500;
        (*small.Find(std::string("emission.") + channel))[p] = seen;
      }
    }
    const ErrorModel model =
        FitErrorModel({kWindow, kPilotTileSizePx, kPilotTileSizePx}, pilot, {}, {});
    EXPECT_EQ(model.silhouettes.empty(), seen == 0);
    const Forecast low = ForecastTarget(model, {.target_error = 0.005}, 1 << 20, -kBandDeviations);
    const Forecast high = ForecastTarget(model, {.target_error = 0.005}, 1 << 20, kBandDeviations);
    EXPECT_LE(low.cpu_seconds, high.cpu_seconds);
    samples.push_back(ForecastTarget(model, {.target_error = 0.005}, 1 << 20).samples);
  }
  EXPECT_GT(samples[1], 2 * samples[0]);
}

TEST(PilotModelTest, FitsDifferentTiles) {
  // Enough blocks that every tile contains one.
  const ErrorModel model = FitOf(
      1, [](int32_t x, int32_t) { return x < 160 ? 0.001 : 0.1; }, 2.0);
  const std::vector<PixelRect> tiles = CutTiles(kWindow, kPilotTileSizePx);
  for (size_t i = 0; i < tiles.size(); ++i) {
    const double error = model.cells[i].measured.error.RelativeMse();
    if (tiles[i].x1 <= 160) {
      EXPECT_LT(error, 0.04) << i;  // A block may extend into a neighbor by a third.
    } else {
      EXPECT_NEAR(error, 0.099, 0.05) << i;
    }
  }
}

// Rounds save time by giving more samples to tiles with larger errors. If all tiles were assumed to
// be alike, rounds would seem to cost as much as equal samples for all.
TEST(PilotModelTest, UncertainTilesDiffer) {
  const ErrorModel model = FitOf(
      1,
      [](int32_t x, int32_t y) {
        return 0.04 * std::exp(0.9 * std::sin(0.7 * (x / 32)) + 0.9 * std::sin(1.1 * (y / 32)));
      },
      0.2);
  double sum = 0, square_sum = 0;
  for (const ForecastCell& cell : model.cells) {
    const double log_error = std::log(cell.measured.error.RelativeMse());
    sum += log_error;
    square_sum += log_error * log_error;
  }
  const auto count = static_cast<double>(model.cells.size());
  EXPECT_NEAR(std::sqrt(square_sum / count - sum * sum / count / count), 0.9, 0.3);
}

// The mean of hundreds of estimates, each with 15 degrees of freedom and so a variance of 2 / 15.
TEST(PilotModelTest, ReportsItsUncertainty) {
  const ErrorModel even = FitOf(1, [](int32_t, int32_t) { return 0.04; });
  EXPECT_LT(even.log_error_deviation, 0.08);
  // One pixel in 50 has nearly all of the error.
  const ErrorModel rare =
      FitOf(1, [](int32_t x, int32_t y) { return (x * 7 + y * 13) % 50 == 0 ? 2.0 : 1e-4; });
  EXPECT_GT(rare.log_error_deviation, 2 * even.log_error_deviation);
}

TEST(PilotModelTest, CpuTimesCoverAllTilesOrNone) {
  const auto times = [](const std::string& text) {
    return TileCpuSecondsOf({{"tileCpuSeconds", text}}, 3);
  };
  EXPECT_EQ(*times("0.5 2e-3 0"), (std::vector<double>{0.5, 2e-3, 0}));
  for (const char* text : {"", "0.5 2", "0.5 2 1 1", "0.5 x 1"}) {
    EXPECT_TRUE(absl::IsDataLoss(times(text).status())) << text;
  }
  EXPECT_TRUE(absl::IsDataLoss(TileCpuSecondsOf({}, 3).status()));  // As from an older coordinator.
  EXPECT_EQ(*CpuSecondsOf({{"lightCpuSeconds", "0.25"}}, "lightCpuSeconds"), 0.25);
  EXPECT_TRUE(absl::IsDataLoss(CpuSecondsOf({}, "lightCpuSeconds").status()));
}

}  // namespace
}  // namespace sheaf::coordinator
