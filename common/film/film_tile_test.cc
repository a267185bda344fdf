// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/film_tile.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

#include "common/film/film_test_samples.h"
#include "common/math/double_float.h"

namespace sheaf {
namespace {

constexpr PixelRect kRect{3, 5, 6, 7};

// The tree by its definition, computed recursively.
DoubleFloat RedOfNode(int32_t x, int32_t y, SampleBlock block) {
  if (block.count == 1) {
    const FilmSample s = MakeTestSample(x, y, block.first);
    return DoubleFloat::Make(double{s.radiance.r} * s.filter_weight);
  }
  const uint64_t half = block.count / 2;
  return Add(RedOfNode(x, y, {block.first, half}), RedOfNode(x, y, {block.first + half, half}));
}
float ReplicateGreenOfNode(int32_t x, int32_t y, uint32_t replicate, SampleBlock points) {
  if (points.count == 1) {
    const FilmSample s = MakeTestSample(x, y, points.first * kReplicateCount + replicate);
    return static_cast<float>(double{s.radiance.g} * s.filter_weight);
  }
  const uint64_t half = points.count / 2;
  return ReplicateGreenOfNode(x, y, replicate, {points.first, half}) +
         ReplicateGreenOfNode(x, y, replicate, {points.first + half, half});
}

TEST(FilmTileTest, AccumulatorBuildsTheCanonicalTree) {
  for (const uint64_t count : {1, 2, 4, 8, 16, 64, 256}) {
    const SampleBlock block{count * 3, count};
    const FilmTile tile = MakeTestTile(kRect, block);
    size_t p = 0;
    for (int32_t y = kRect.y0; y < kRect.y1; ++y) {
      for (int32_t x = kRect.x0; x < kRect.x1; ++x, ++p) {
        const DoubleFloat red{tile.channel(FilmChannel::kRedHi)[p],
                              tile.channel(FilmChannel::kRedLo)[p]};
        EXPECT_EQ(red, RedOfNode(x, y, block));
      }
    }
  }
}

TEST(FilmTileTest, ReplicatesHaveSeparateTrees) {
  const FilmTile large = MakeTestTile(kRect, {128, 128});
  ASSERT_EQ(large.replicate_first(), 0u);
  ASSERT_EQ(large.replicate_count(), kReplicateCount);
  for (uint32_t slot = 0; slot < kReplicateCount; ++slot) {
    EXPECT_EQ(large.replicate(slot, 1)[0], ReplicateGreenOfNode(kRect.x0, kRect.y0, slot, {8, 8}));
  }
  // A small block holds only the replicates of its samples.
  const FilmTile small = MakeTestTile(kRect, {40, 4});
  ASSERT_EQ(small.replicate_first(), 8u);
  ASSERT_EQ(small.replicate_count(), 4u);
  EXPECT_EQ(small.replicate(3, 1)[0], ReplicateGreenOfNode(kRect.x0, kRect.y0, 11, {2, 1}));
  EXPECT_LT(small.size_bytes(), large.size_bytes());
}

TEST(FilmTileTest, MergingSiblingsGivesTheParent) {
  for (const uint64_t count : {1, 2, 8, 16, 32}) {
    const SampleBlock left{count * 6, count};
    const FilmTile merged =
        MergeSiblings(MakeTestTile(kRect, left), MakeTestTile(kRect, Sibling(left)));
    EXPECT_TRUE(SameBits(merged, MakeTestTile(kRect, Parent(left)))) << count;
  }
}

// A pixel of a lattice's rim has the same sums as in a tile of only those samples.
TEST(FilmTileTest, PixelsMayHaveOnlyTheFirstSamples) {
  FilmTile tile(kRect, {0, 64});
  PixelAccumulator accumulator(&tile);
  for (const uint64_t count : {64, 4}) {  // The second count must not see leftovers of the first.
    accumulator.Begin(kRect.x0, kRect.y0);
    for (uint64_t s = 0; s < count; ++s) {
      accumulator.Add(s, MakeTestSample(kRect.x0, kRect.y0, s));
    }
    accumulator.End();
  }
  const FilmTile few = MakeTestTile(kRect, {0, 4});
  for (size_t i = 0; i < kFilmChannelCount; ++i) {
    const auto channel = static_cast<FilmChannel>(i);
    EXPECT_EQ(tile.channel(channel)[0], few.channel(channel)[0]) << i;
  }
  for (uint32_t slot = 0; slot < kReplicateCount; ++slot) {
    for (size_t i = 0; i < kReplicateChannelCount; ++i) {
      EXPECT_EQ(tile.replicate(slot, i)[0], slot < 4 ? few.replicate(slot, i)[0] : 0.0F);
    }
  }
}

TEST(FilmTileTest, SumsAreWeightedByTheFilter) {
  FilmTile tile({0, 0, 1, 1}, {0, 1});
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  accumulator.Add(0, {.radiance = {1, 2, 3},
                      .alpha = 1,
                      .filter_weight = -0.5f,
                      .albedo = {0.2f, 0.4f, 0.6f},
                      .normal = {0, 0, 1},
                      .depth = 8});
  accumulator.End();
  EXPECT_EQ(tile.channel(FilmChannel::kBlueHi)[0], -1.5f);
  EXPECT_EQ(tile.channel(FilmChannel::kWeight)[0], -0.5f);
  EXPECT_EQ(tile.channel(FilmChannel::kAlpha)[0], -0.5f);
  EXPECT_EQ(tile.channel(FilmChannel::kAlbedoG)[0], -0.2f);
  EXPECT_EQ(tile.channel(FilmChannel::kNormalZ)[0], -0.5f);
  EXPECT_EQ(tile.channel(FilmChannel::kDepth)[0], -4.0f);
  EXPECT_EQ(tile.channel(FilmChannel::kSampleCount)[0], 1.0f);
  EXPECT_EQ(tile.replicate(0, 2)[0], -1.5f);
  EXPECT_EQ(tile.replicate(0, 3)[0], -0.5f);
}

TEST(FilmTileTest, NonFiniteSamplesAreOnlyCountedAndReported) {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const FilmSample good{.radiance = {1, 1, 1}, .alpha = 1};
  std::vector<FilmSample> samples(16, good);
  samples[1].radiance.g = kNan;
  samples[2].radiance.b = -kInf;
  samples[3].alpha = kNan;
  samples[4].filter_weight = kInf;
  samples[5].albedo.r = kNan;
  samples[6].normal.y = kInf;
  samples[7].depth = kNan;
  samples[8].radiance.r = 2 * kSampleMagnitudeMax;
  samples[9].radiance.r = 1e29f;
  samples[9].filter_weight = 100;
  FilmTile tile({4, 2, 5, 3}, {32, 16});
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(4, 2);
  for (uint64_t i = 0; i < 16; ++i) accumulator.Add(32 + i, samples[i]);
  accumulator.End();
  EXPECT_EQ(tile.channel(FilmChannel::kNonFiniteCount)[0], 9.0f);
  EXPECT_EQ(tile.channel(FilmChannel::kSampleCount)[0], 7.0f);
  EXPECT_EQ(tile.channel(FilmChannel::kRedHi)[0], 7.0f);
  EXPECT_EQ(tile.channel(FilmChannel::kWeight)[0], 7.0f);
  EXPECT_EQ(tile.replicate(5, 3)[0], 0.0f);
  ASSERT_EQ(accumulator.non_finite().size(), 9u);
  EXPECT_EQ(accumulator.non_finite()[0].sample_index, 33u);
  EXPECT_EQ(accumulator.non_finite()[0].x, 4);
  EXPECT_EQ(accumulator.non_finite()[0].y, 2);
}

TEST(FilmTileTest, ReportsOfBadSamplesAreLimited) {
  FilmTile tile({0, 0, 1, 1}, {0, 64});
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  for (uint64_t n = 0; n < 64; ++n)
    accumulator.Add(n, {.depth = std::numeric_limits<float>::infinity()});
  accumulator.End();
  EXPECT_EQ(accumulator.non_finite().size(), PixelAccumulator::kNonFiniteReportsMax);
  EXPECT_EQ(tile.channel(FilmChannel::kNonFiniteCount)[0], 64.0f);
}

TEST(FilmTileDeathTest, MisuseAborts) {
  FilmTile tile({0, 0, 1, 1}, {4, 4});
  PixelAccumulator accumulator(&tile);
  accumulator.Begin(0, 0);
  EXPECT_DEATH(accumulator.Add(5, {}), "check failed");
  EXPECT_DEATH(accumulator.End(), "check failed");
  EXPECT_DEATH(accumulator.Begin(1, 0), "check failed");
  EXPECT_DEATH(FilmTile({0, 0, 1, 1}, {2, 4}), "check failed");
  EXPECT_DEATH(MergeSiblings(tile, tile), "check failed");
}

}  // namespace
}  // namespace sheaf
