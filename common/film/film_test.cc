// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/film.h"
#include "common/film/error/error_estimate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>

#include "common/film/film_test_samples.h"
#include "common/film/pixel_replicates.h"

namespace sheaf {
namespace {

// A tile with one row of pixels whose samples are given by a function of (x, n).
template <typename Sample>
FilmTile MakeTile(int32_t width, uint64_t count, const Sample& sample) {
  FilmTile tile({0, 0, width, 1}, {0, count});
  PixelAccumulator accumulator(&tile);
  for (int32_t x = 0; x < width; ++x) {
    accumulator.Begin(x, 0);
    for (uint64_t n = 0; n < count; ++n) accumulator.Add(n, sample(x, n));
    accumulator.End();
  }
  return tile;
}

float At(const FrameImage& image, const char* channel, size_t p) {
  return image.Find(channel)->at(p);
}

TEST(FilmTest, DevelopsMeansInPlace) {
  FilmTile tile({10, 20, 12, 21}, {0, 2});
  PixelAccumulator accumulator(&tile);
  for (int32_t x = 10; x < 12; ++x) {
    accumulator.Begin(x, 20);
    accumulator.Add(0, {.radiance = {2, 4, 6},
                        .alpha = 1,
                        .filter_weight = 2,
                        .albedo = {0.5f, 0, 0},
                        .normal = {0, 1, 0},
                        .depth = 10});
    accumulator.Add(1, {.radiance = {1, 1, 1}, .alpha = 0, .filter_weight = 1});
    accumulator.End();
  }
  FrameImage image = MakeFrameImage({8, 19, 14, 22}, 640, 480);
  DevelopTile(tile, &image);
  const size_t p = 1 * 6 + 2;
  EXPECT_EQ(At(image, "R", p), static_cast<float>(5.0 / 3));
  EXPECT_EQ(At(image, "G", p + 1), 3.0f);
  EXPECT_EQ(At(image, "A", p), static_cast<float>(2.0 / 3));
  EXPECT_EQ(At(image, "albedo.R", p), static_cast<float>(1.0 / 3));
  EXPECT_EQ(At(image, "normal.Y", p), static_cast<float>(2.0 / 3));
  EXPECT_EQ(At(image, "depth.Z", p), 10.0f);  // The mean over the hits.
  EXPECT_EQ(At(image, "samples", p), 2.0f);
  EXPECT_EQ(At(image, "R", 0), 0.0f);
  EXPECT_EQ(At(image, "samples", 0), 0.0f);
}

TEST(FilmTest, ZeroWeightGivesZero) {
  const FilmTile tile = MakeTile(1, 2, [](int32_t, uint64_t n) {
    return FilmSample{.radiance = {3, 1, 2},
                      .alpha = 1,
                      .filter_weight = n == 0 ? 1.0f : -1.0f,
                      .depth = 1.0f + static_cast<float>(n)};
  });
  FrameImage image = MakeFrameImage(tile.rect(), 1, 1);
  DevelopTile(tile, &image);
  for (const auto& plane : image.planes) EXPECT_TRUE(std::isfinite(plane[0]));
  EXPECT_EQ(At(image, "R", 0), 0.0f);
  EXPECT_EQ(At(image, "depth.Z", 0), 0.0f);
  EXPECT_EQ(At(image, "stderr.R", 0), 0.0f);
}

TEST(FilmTest, StandardErrorComesFromReplicateMeans) {
  // Replicate means 0 .. 15 exactly: variance of the mean (16^2 - 1) / 12 / 15 = 17 / 12.
  const FilmTile tile = MakeTile(1, 64, [](int32_t, uint64_t n) {
    return FilmSample{.radiance = Rgb::Gray(static_cast<float>(n % 16))};
  });
  EXPECT_NEAR(PixelReplicates(tile, 0).StandardError(0), std::sqrt(17.0 / 12), 1e-12);
}

TEST(FilmTest, StandardErrorNeedsTwoReplicates) {
  const auto sample = [](int32_t, uint64_t n) {
    return FilmSample{.radiance = Rgb::Gray(1.0f + static_cast<float>(n))};
  };
  EXPECT_EQ(PixelReplicates(MakeTile(1, 1, sample), 0).StandardError(0), 0);
  EXPECT_NEAR(PixelReplicates(MakeTile(1, 2, sample), 0).StandardError(0), 0.5, 1e-12);
}

// Over many pixels of known mean, the interval mean +- t standard errors contains the truth as
// often as Student's distribution predicts: t(15) at 95 % is 2.1314.
TEST(FilmTest, ErrorBarsHaveStudentsCoverage) {
  constexpr int32_t kPixels = 4000;
  for (const uint64_t count : {64, 256}) {
    const FilmTile tile = MakeTile(kPixels, count, [](int32_t x, uint64_t n) {
      return FilmSample{.radiance = Rgb::Gray(HashToUnit(static_cast<uint64_t>(x) * 100003 + n))};
    });
    FrameImage image = MakeFrameImage(tile.rect(), kPixels, 1);
    DevelopTile(tile, &image);
    int covered = 0;
    for (size_t p = 0; p < kPixels; ++p) {
      covered += std::fabs(At(image, "G", p) - 0.5f) <= 2.1314f * At(image, "stderr.G", p);
    }
    // Binomial standard deviation 0.0034: four of them.
    EXPECT_NEAR(covered / double{kPixels}, 0.95, 0.014) << count;
  }
}

// 24 samples: half of the replicates hold twice as many as the others.
TEST(FilmTest, UnequalReplicatesKeepTheErrorUnbiased) {
  constexpr int32_t kPixels = 4000;
  TileTree tree({0, 0, kPixels, 1});
  for (const SampleBlock block : {SampleBlock{0, 16}, SampleBlock{16, 8}}) {
    FilmTile tile(tree.rect(), block);
    PixelAccumulator accumulator(&tile);
    for (int32_t x = 0; x < kPixels; ++x) {
      accumulator.Begin(x, 0);
      for (uint64_t n = block.first; n < block.End(); ++n) {
        accumulator.Add(n,
                        {.radiance = Rgb::Gray(HashToUnit(static_cast<uint64_t>(x) * 7919 + n))});
      }
      accumulator.End();
    }
    ASSERT_TRUE(tree.Insert(std::move(tile)).ok());
  }
  const FilmTile root = tree.Root();
  double variance = 0;
  for (size_t p = 0; p < kPixels; ++p) {
    const double e = PixelReplicates(root, p).StandardError(0);
    variance += e * e / kPixels;
  }
  const double truth = 1.0 / 12 / 24;
  EXPECT_NEAR(variance / truth, 1, 0.05);
}

TEST(FilmTest, FrameErrorPredictsRelativeMse) {
  constexpr int32_t kPixels = 3000;
  constexpr uint64_t kCount = 64;
  const auto truth = [](int32_t x) { return 0.2f + 0.001f * static_cast<float>(x); };
  const FilmTile tile = MakeTile(kPixels, kCount, [&](int32_t x, uint64_t n) {
    const uint64_t key = static_cast<uint64_t>(x) * 1000003 + n * 3;
    return FilmSample{.radiance = {2 * truth(x) * HashToUnit(key),
                                   2 * truth(x) * HashToUnit(key + 1),
                                   2 * truth(x) * HashToUnit(key + 2)}};
  });
  FrameImage image = MakeFrameImage(tile.rect(), kPixels, 1);
  DevelopTile(tile, &image);
  const FrameError error = EstimateError(image);
  double mean = 0, actual = 0;
  for (int32_t x = 0; x < kPixels; ++x) mean += truth(x) / kPixels;
  for (int32_t x = 0; x < kPixels; ++x) {
    for (const char* channel : {"R", "G", "B"}) {
      const double d = At(image, channel, static_cast<size_t>(x)) - truth(x);
      actual += d * d / (truth(x) * truth(x) + 0.01 * mean * mean) / (3 * kPixels);
    }
  }
  EXPECT_NEAR(error.relative_mse / actual, 1, 0.1);
  EXPECT_EQ(error.sample_count, kPixels * kCount);
  EXPECT_EQ(error.nonfinite_count, 0u);
  EXPECT_GT(error.standard_error, 0);
  EXPECT_LT(error.standard_error, 0.01);
}

// One sample in 400 is 200 times as bright as the others. Most pixels have no bright sample, and
// the pixels that have one look accurate by their own means.
TEST(FilmTest, FrameErrorAccountsForRareBrightSamples) {
  constexpr int32_t kPixels = 64 * 64;
  constexpr uint64_t kCount = 64;
  constexpr double kTruth = 0.1 + 20.0 / 400;
  const FilmTile row = MakeTile(kPixels, kCount, [](int32_t x, uint64_t n) {
    const bool bright = HashToUnit(static_cast<uint64_t>(x) * 1000003 + n) < 1 / 400.0f;
    return FilmSample{.radiance = Rgb::Gray(bright ? 20.1f : 0.1f)};
  });
  FrameImage of_row = MakeFrameImage(row.rect(), kPixels, 1);
  DevelopTile(row, &of_row);
  FrameImage image = MakeFrameImage({0, 0, 64, 64}, 64, 64);
  image.planes = of_row.planes;
  double actual = 0, by_own_mean = 0;
  for (size_t p = 0; p < kPixels; ++p) {
    const double v = At(image, "R", p), s = At(image, "stderr.R", p);
    actual += (v - kTruth) * (v - kTruth) / (1.01 * kTruth * kTruth) / kPixels;
    by_own_mean += s * s / (v * v + 0.01 * kTruth * kTruth) / kPixels;
  }
  EXPECT_NEAR(EstimateError(image).relative_mse / actual, 1, 0.15);
  EXPECT_LT(by_own_mean / actual, 0.15);
}

// An emitter 1,000 times as bright as the background, and pixels on its silhouette that it covers
// by almost any fraction. If one of a pixel's 32 samples hit the emitter, the true fraction may be
// far below 1 / 32, and the actual error far above the observed deviation.
TEST(FilmTest, FrameErrorBoundAccountsForEmitterSilhouettes) {
  constexpr int32_t kSide = 48, kPixels = kSide * kSide;
  constexpr int kImages = 60;
  constexpr float kEmitter = 500, kWall = 0.5f;
  // An emitter of 16 pixels; next to them, silhouette pixels whose covered fraction is more often
  // small than large.
  const auto fraction = [](int32_t p) {
    const int32_t x = p % kSide, y = p / kSide;
    if (y % 3 != 0 || x > 1) return 0.0f;
    return x == 0 ? 1.0f : 0.05f * std::pow((static_cast<float>(y) + 0.5f) / kSide, 2.0f);
  };
  int missed = 0, missed_by_variance = 0;
  for (uint64_t seed = 0; seed < kImages; ++seed) {
    const FilmTile row = MakeTile(kPixels, 32, [&](int32_t p, uint64_t n) {
      const uint64_t key = (seed * kPixels + static_cast<uint64_t>(p)) * 1000003 + n;
      return FilmSample{.radiance = Rgb::Gray(HashToUnit(key) < fraction(p) ? kEmitter : kWall)};
    });
    FrameImage of_row = MakeFrameImage(row.rect(), kPixels, 1);
    DevelopTile(row, &of_row);
    FrameImage image = MakeFrameImage({0, 0, kSide, kSide}, kSide, kSide);
    image.planes = of_row.planes;
    double mean = 0, actual = 0, squares = 0;
    for (const float v : *image.Find("R")) mean += v / kPixels;
    for (const ErrorSums& pixel : EstimateTileErrors(image, CutTiles(image.window, 1))) {
      squares += pixel.sum * pixel.sum;
    }
    for (int32_t p = 0; p < kPixels; ++p) {
      const double truth = fraction(p) * kEmitter + (1 - fraction(p)) * kWall;
      const double d = At(image, "R", static_cast<size_t>(p)) - truth;
      actual += d * d / (truth * truth + 0.01 * mean * mean) / kPixels;
    }
    const FrameError error = EstimateError(image);
    missed += actual > error.relative_mse + 2 * error.relative_mse_deviation;
    missed_by_variance += actual > error.relative_mse + 2 * std::sqrt(2 * squares) / kPixels;
  }
  EXPECT_LE(missed, 0.1 * kImages);
  EXPECT_GE(missed_by_variance, 0.1 * kImages);
}

// With this many pixels the statistical error vanishes, and kEstimateDeviation remains.
TEST(FilmTest, LargeFrameErrorsHaveAnUncertainty) {
  const ErrorSums sums{100'000'000, 1e6, 1e4};
  EXPECT_NEAR(sums.Deviation() / sums.RelativeMse(), kEstimateDeviation, 1e-5);
  EXPECT_EQ(ErrorSums{}.Deviation(), 0);
}

TEST(FilmTest, TileErrorsAddUpToTheFrameError) {
  const FilmTile tile = MakeTile(64, 32, [](int32_t x, uint64_t n) {
    return FilmSample{.radiance = Rgb::Gray(HashToUnit(static_cast<uint64_t>(x) * 7919 + n))};
  });
  FrameImage image = MakeFrameImage(tile.rect(), 64, 1);
  DevelopTile(tile, &image);
  const std::array<PixelRect, 2> halves{{{0, 0, 20, 1}, {20, 0, 64, 1}}};
  ErrorSums both;
  for (const ErrorSums& half : EstimateTileErrors(image, halves)) both.Add(half);
  const FrameError frame = EstimateError(image);
  EXPECT_EQ(both.pixel_count, 64);
  EXPECT_NEAR(both.RelativeMse(), frame.relative_mse, 1e-12 * frame.relative_mse);
  EXPECT_NEAR(both.Deviation(), frame.relative_mse_deviation, 1e-12 * both.Deviation());
}

TEST(FilmTest, TileErrorsUseTheGivenMean) {
  const FilmTile tile = MakeTile(64, 32, [](int32_t x, uint64_t n) {
    return FilmSample{.radiance = Rgb::Gray(HashToUnit(static_cast<uint64_t>(x) * 7919 + n))};
  });
  FrameImage image = MakeFrameImage(tile.rect(), 64, 1);
  DevelopTile(tile, &image);
  const std::array<PixelRect, 1> all{tile.rect()};
  const auto error = [&](double mean) {
    return EstimateTileErrors(image, all, mean)[0].RelativeMse();
  };
  EXPECT_NEAR(MeanOfImage(image), 0.5, 0.05);
  EXPECT_DOUBLE_EQ(EstimateTileErrors(image, all)[0].RelativeMse(), error(MeanOfImage(image)));
  // 1 / (.5^2 + (.1 m)^2) for m of .5 and of 20; the pixels differ little.
  EXPECT_NEAR(error(20) / error(0.5), (0.25 + 0.0025) / (0.25 + 4), 0.01);
}

TEST(FilmTest, FrameErrorOfAnEmptyFrameIsZero) {
  const FrameError error = EstimateError(MakeFrameImage({0, 0, 4, 4}, 4, 4));
  EXPECT_EQ(error.relative_mse, 0);
  EXPECT_EQ(error.standard_error, 0);
  EXPECT_EQ(error.sample_count, 0u);
}

TEST(FilmTest, DigestCoversEveryBitOfTheImageOnly) {
  FrameImage image = MakeFrameImage({0, 0, 4, 4}, 4, 4);
  const std::string digest = ImageDigest(image);
  EXPECT_EQ(digest.size(), 64u);
  image.metadata["finishedTime"] = "later";
  EXPECT_EQ(ImageDigest(image), digest);
  image.Find("B")->at(7) = -0.0f;
  EXPECT_NE(ImageDigest(image), digest);
  image.Find("B")->at(7) = 0;
  EXPECT_EQ(ImageDigest(image), digest);
  image.channel_names[0] = "Q";
  EXPECT_NE(ImageDigest(image), digest);
}

TEST(FilmTest, DigestIgnoresTheChannelOrder) {
  FrameImage image = MakeFrameImage({0, 0, 2, 1}, 2, 1);
  *image.Find("R") = {1, 2};
  *image.Find("B") = {3, 4};
  const std::string digest = ImageDigest(image);
  FrameImage reordered = image;
  std::reverse(reordered.channel_names.begin(), reordered.channel_names.end());
  std::reverse(reordered.planes.begin(), reordered.planes.end());
  EXPECT_EQ(ImageDigest(reordered), digest);
  // Planes with exchanged names are a different image.
  std::swap(*reordered.Find("R"), *reordered.Find("B"));
  EXPECT_NE(ImageDigest(reordered), digest);
}

}  // namespace
}  // namespace sheaf
