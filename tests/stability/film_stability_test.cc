// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The film's rows of the catalogue of hard cases, which break float accumulation.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/film/exr/exr_codec.h"
#include "common/film/film.h"
#include "common/film/film_test_samples.h"
#include "common/film/pixel_replicates.h"
#include "common/math/double_float.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_sampling.h"

namespace sheaf {
namespace {

constexpr PixelRect kOnePixel{0, 0, 1, 1};

template <typename Sample>
FilmTile MakeOnePixelTile(SampleBlock block, const Sample& sample) {
  FilmTile tile(kOnePixel, block);
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  for (uint64_t n = block.first; n < block.End(); ++n) accumulator.Add(n, sample(n));
  accumulator.End();
  return tile;
}

float DevelopRed(const FilmTile& tile) {
  FrameImage image = MakeFrameImage(tile.rect(), tile.rect().x1, tile.rect().y1);
  DevelopTile(tile, &image);
  return image.Find("R")->at(0);
}

// Radiance and weight as the film stores them, before the image rounds them to float.
double WideMean(const FilmTile& tile) {
  const auto value = [&tile](FilmChannel hi, FilmChannel lo) {
    return DoubleFloat{tile.channel(hi)[0], tile.channel(lo)[0]}.Value();
  };
  return value(FilmChannel::kRedHi, FilmChannel::kRedLo) /
         value(FilmChannel::kWeight, FilmChannel::kWeightLo);
}

// The same sums over another block. Requires: both blocks hold the same number of replicates.
FilmTile MovedTo(const FilmTile& tile, SampleBlock block) {
  FilmTile moved(tile.rect(), block);
  std::copy_n(tile.channel(FilmChannel{}), kFilmChannelCount * tile.plane_size(),
              moved.channel(FilmChannel{}));
  std::copy_n(tile.replicate(0, 0),
              tile.replicate_count() * kReplicateChannelCount * tile.plane_size(),
              moved.replicate(0, 0));
  return moved;
}

// A node over equal samples: it merges two copies of its half, so log2(count) steps suffice.
FilmTile MakeUniformNode(const FilmSample& sample, SampleBlock block) {
  if (block.count <= kReplicateCount) {
    return MakeOnePixelTile(block, [&](uint64_t) { return sample; });
  }
  const FilmTile half = MakeUniformNode(sample, {block.first, block.count / 2});
  return MergeSiblings(half, MovedTo(half, Sibling(half.block())));
}

TEST(FilmStabilityTest, C2NegativeLobesKeepAConstantConstant) {
  constexpr float kConstant = 0.7f;
  for (const uint64_t count : {1, 16, 64, 1024, 65536}) {
    const FilmTile tile = MakeOnePixelTile({0, count}, [&](uint64_t n) {
      FilmSample s;
      s.radiance = Rgb::Gray(kConstant);
      // A quarter of the samples is in the negative lobes; weights vary.
      s.filter_weight = (HashToUnit(2 * n) < 0.25f ? -0.4f : 1.2f) * (0.5f + HashToUnit(2 * n + 1));
      return s;
    });
    EXPECT_NEAR(DevelopRed(tile), kConstant, 1e-6 * kConstant) << count;
    // The error bar of a constant contains only rounding.
    EXPECT_LE(PixelReplicates(tile, 0).StandardError(0), 1e-6 * kConstant) << count;
  }
}

TEST(FilmStabilityTest, C2WeightsThatSumToZeroGiveZero) {
  const FilmTile tile = MakeOnePixelTile({0, 64}, [](uint64_t n) {
    FilmSample s;
    s.radiance = Rgb::Gray(1 + HashToUnit(n));
    s.alpha = 1;
    s.depth = 3;
    s.filter_weight = n % 2 == 0 ? 0.75f : -0.75f;
    return s;
  });
  FrameImage image = MakeFrameImage(kOnePixel, 1, 1);
  DevelopTile(tile, &image);
  for (size_t i = 0; i < image.planes.size(); ++i) {
    EXPECT_TRUE(std::isfinite(image.planes[i][0])) << image.channel_names[i];
  }
  std::vector<float> values, weights;
  for (uint64_t n = 0; n < 64; ++n) {
    values.push_back(1 + HashToUnit(n));
    weights.push_back(n % 2 == 0 ? 0.75f : -0.75f);
  }
  ExpectHardCase({.row = "C2",
                  .figure = "pixel whose filter weights sum to 0",
                  .expected = 0,
                  .measured = image.Find("R")->at(0),
                  .naive = naive::WeightedMean(values, weights),
                  .naive_by = "sum of w v over sum of w"});
}

TEST(FilmStabilityTest, C2NegativeValuesAreKept) {
  const FilmTile tile = MakeOnePixelTile({0, 4}, [](uint64_t n) {
    FilmSample s;
    s.radiance = Rgb::Gray(n == 0 ? 10.0f : 0.0f);
    s.filter_weight = n == 0 ? -0.2f : 1.0f;
    return s;
  });
  EXPECT_NEAR(DevelopRed(tile), -2 / 2.8, 1e-6);
}

// 10^9 samples = 2^29 + 2^28 + ...: nodes of equal samples from equal halves, merged by the tree.
TEST(FilmStabilityTest, C3ABillionSamplesKeepTheirMean) {
  constexpr uint64_t kCount = 1000000000;
  FilmSample sample;
  sample.radiance = {0.4999734f, 0.1f, 3e-5f};
  for (const float weight : {1.0f, 0.837f}) {
    sample.filter_weight = weight;
    TileTree tree(kOnePixel);
    for (const SampleBlock& block : CutSamples(0, kCount, uint64_t{1} << 40)) {
      ASSERT_TRUE(tree.Insert(MakeUniformNode(sample, block)).ok());
    }
    ASSERT_EQ(tree.SampleCount(), kCount);
    const FilmTile root = tree.Root();
    const double exact = sample.radiance.r;
    ExpectHardCase({.row = "C3",
                    .figure = "mean of 10^9 samples",
                    .expected = exact,
                    .measured = WideMean(root),
                    .tolerance = 1e-9 * exact,
                    .naive = naive::MeanOfEqual(sample.radiance.r, kCount),
                    .naive_by = "running sum over the number"});
    EXPECT_EQ(DevelopRed(root), sample.radiance.r);
    EXPECT_LE(PixelReplicates(root, 0).StandardError(0), 1e-6 * exact);
  }
}

// The same with actual samples: the mean of 2^24 random ones, for which float sums stall, is
// compared with a long double sum.
TEST(FilmStabilityTest, C3SixteenMillionRandomSamplesKeepTheirMean) {
  constexpr uint64_t kCount = 1 << 24;
  FilmTile tile(kOnePixel, {0, kCount});
  PixelAccumulator accumulator(&tile);
  long double sum = 0, weight_sum = 0;
  FilmSample s;
  accumulator.Begin(0, 0);
  for (uint64_t n = 0; n < kCount; ++n) {
    const float u = HashToUnit(n);
    s.radiance.r = u < 1e-3f ? 5000 * u : u;
    s.filter_weight = u < 0.1f ? -0.25f : 1.1f;
    sum += static_cast<long double>(s.radiance.r) * s.filter_weight;
    weight_sum += s.filter_weight;
    accumulator.Add(n, s);
  }
  accumulator.End();
  const auto exact = static_cast<double>(sum / weight_sum);
  EXPECT_NEAR(WideMean(tile) / exact, 1, 1e-9);
  EXPECT_EQ(tile.channel(FilmChannel::kSampleCount)[0], static_cast<float>(kCount));
}

TEST(FilmStabilityTest, C4AMillionUnitsOfRadianceAreKept) {
  const FilmTile tile = MakeOnePixelTile({0, 64}, [](uint64_t) {
    FilmSample s;
    s.radiance = {1e6f, 65504.0f, 65536.0f};
    return s;
  });
  FrameImage image = MakeFrameImage(kOnePixel, 1, 1);
  DevelopTile(tile, &image);
  const absl::StatusOr<FrameImage> read = DecodeFrameImage(EncodeFrameImage(image));
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectHardCase({.row = "C4",
                  .figure = "radiance of 10^6, read back from the file",
                  .expected = 1e6f,
                  .measured = read->Find("R")->at(0),
                  .naive = naive::AsHalf(1e6f),
                  .naive_by = "as a 16-bit float"});
  EXPECT_EQ(read->Find("G")->at(0), 65504.0f);
  EXPECT_EQ(read->Find("B")->at(0), 65536.0f);
  const absl::StatusOr<DecodedPart> part = DecodePart(EncodePart(tile, {}));
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_TRUE(SameBits(part->tile, tile));
}

TEST(FilmStabilityTest, C5SampleIndicesBeyondThirtyTwoBits) {
  for (const uint64_t first : {uint64_t{1} << 33, (uint64_t{1} << 33) + 48, uint64_t{1} << 61}) {
    const SampleBlock block{first, 16};
    const FilmTile tile = MakeTestTile(kOnePixel, block);
    const absl::StatusOr<DecodedPart> part = DecodePart(EncodePart(tile, {}));
    ASSERT_TRUE(part.ok()) << part.status();
    EXPECT_EQ(part->tile.block(), block);
    ExpectHardCase({.row = "C5",
                    .figure = "first sample of a part, read back: " + InWords(first),
                    .expected = first,
                    .measured = part->tile.block().first,
                    .naive = static_cast<uint32_t>(first),
                    .naive_by = "index of 32 bits"});
    EXPECT_TRUE(SameBits(part->tile, tile));
    TileTree tree(kOnePixel);
    ASSERT_TRUE(tree.Insert(part->tile).ok());
    ASSERT_TRUE(tree.Insert(MakeTestTile(kOnePixel, Sibling(block))).ok());
    EXPECT_TRUE(tree.Covers(Parent(block)));
    EXPECT_FALSE(tree.Covers({first & 0xffffffff, 16}));
  }
  EXPECT_EQ(ReplicateOf((uint64_t{1} << 33) + 5), 5u);
  EXPECT_EQ(IndexInReplicate(uint64_t{1} << 40), uint64_t{1} << 36);
}

TEST(FilmStabilityTest, C5WindowsSeventyThousandPixelsLong) {
  for (const PixelRect window : {PixelRect{0, 0, 70000, 1}, {0, 0, 1, 70000}}) {
    FrameImage image = MakeFrameImage(window, window.x1, window.y1);
    std::vector<PixelRect> tiles = CutTiles(window, 64);
    EXPECT_EQ(tiles.size(), 1094u);
    for (const PixelRect& tile : tiles) DevelopTile(MakeTestTile(tile, {0, 2}), &image);
    const std::vector<float>& samples = *image.Find("samples");
    EXPECT_EQ(std::count(samples.begin(), samples.end(), 2.0f), 70000);
    const absl::StatusOr<FrameImage> read = DecodeFrameImage(EncodeFrameImage(image));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(*read->Find("R"), *image.Find("R"));
  }
}

// Hosts may finish in any order and with passes of any size; the frame is the same to the bit.
TEST(FilmStabilityTest, C6HostsMayFinishInAnyOrder) {
  constexpr PixelRect kWindow{0, 0, 24, 16};
  constexpr uint64_t kSamples = 40;
  std::string digest;
  std::set<std::string> digests;
  std::set<float> sums;
  std::vector<float> values(kSamples);
  for (size_t i = 0; i < kSamples; ++i) values[i] = HashToUnit(i);
  std::mt19937 bits(6);
  for (const uint64_t pass_samples : {64, 16, 8, 4, 2, 1}) {
    for (const int32_t tile_size_px : {8, 16, 64}) {
      FrameImage image = MakeFrameImage(kWindow, 24, 16);
      for (const PixelRect& rect : CutTiles(kWindow, tile_size_px)) {
        std::vector<SampleBlock> passes = CutSamples(0, kSamples, pass_samples);
        std::shuffle(passes.begin(), passes.end(), bits);
        TileTree tree(rect);
        for (const SampleBlock& pass : passes)
          ASSERT_TRUE(tree.Insert(MakeTestTile(rect, pass)).ok());
        DevelopTile(tree.Root(), &image);
      }
      if (digest.empty()) digest = ImageDigest(image);
      EXPECT_EQ(ImageDigest(image), digest) << pass_samples << " a pass, tiles of " << tile_size_px;
      digests.insert(ImageDigest(image));
      std::shuffle(values.begin(), values.end(), bits);
      sums.insert(naive::Sum(values));
    }
  }
  ExpectHardCase({.row = "C6",
                  .figure = "different images of 18 orders in which hosts finish",
                  .expected = 1,
                  .measured = digests.size(),
                  .naive = sums.size(),
                  .naive_by = "different running sums of 40 samples in 18 orders"});
}

// Values 10^6 +- 10^-3 are equal as floats: the film must report 0 and not the root of a negative
// number. The smallest spread that a float can represent there, a sixteenth, must be detected up to
// float rounding.
TEST(FilmStabilityTest, R9VarianceOfNearlyEqualLargeValues) {
  const auto error_of = [](double spread, uint64_t count) {
    return PixelReplicates(MakeOnePixelTile({0, count},
                                            [spread](uint64_t n) {
                                              const double v = 1e6 + spread * (n % 2 == 0 ? 1 : -1);
                                              FilmSample s;
                                              s.radiance = Rgb::Gray(static_cast<float>(v));
                                              return s;
                                            }),
                           0)
        .StandardError(0);
  };
  EXPECT_EQ(error_of(1e-3, 16), 0);
  EXPECT_EQ(error_of(1e-3, 1024), 0);
  // Replicates alternate between 10^6 + s and 10^6 - s: the error of the mean is s / sqrt(15).
  for (const double spread : {0.0625, 0.25, 100.0}) {
    std::vector<float> values;
    for (int i = 0; i < 16; ++i) {
      values.push_back(static_cast<float>(1e6 + (i % 2 == 0 ? spread : -spread)));
    }
    ExpectHardCase({.row = "R9",
                    .figure = "standard error of 10^6 +- " + InWords(spread),
                    .expected = spread / std::sqrt(15.0),
                    .measured = error_of(spread, 16),
                    .tolerance = 1e-6 * spread,
                    .naive = naive::StandardError(values),
                    .naive_by = "E[x^2] - E[x]^2"});
    EXPECT_NEAR(error_of(spread, 1024), spread / std::sqrt(15.0), 1e6 * 0x1p-22) << spread;
  }
}

}  // namespace
}  // namespace sheaf
