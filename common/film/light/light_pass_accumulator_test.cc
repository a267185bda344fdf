// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/light/light_pass_accumulator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <utility>

#include "common/film/film_test_samples.h"
#include "common/film/task_kind.h"
#include "common/film/tile_tree.h"
#include "common/math/double_float.h"

namespace sheaf {
namespace {

constexpr PixelRect kRect{2, 1, 7, 5};
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Splat {
  int32_t x = 0, y = 0;
  Rgb value;
  float weight = 1;
  size_t group = 0;
};

// Some splats on each pixel, magnitudes far apart and weights of both signs, some outside.
std::vector<Splat> SplatsOf(uint64_t pass) {
  uint64_t key = pass * 4096;
  const auto next = [&key] { return HashToUnit(key++); };
  std::vector<Splat> splats;
  for (int i = 0; i < 60; ++i) {
    const auto x = static_cast<int32_t>(next() * 9), y = static_cast<int32_t>(next() * 7);
    const float scale = next() < 0.1f ? 1e6f : 1.0f;
    splats.push_back({x,
                      y,
                      {next() * scale, next(), next() * 0.01f},
                      next() - 0.3f,
                      next() < 0.5f ? size_t{0} : size_t{1}});
  }
  return splats;
}

FilmOutputs TwoGroups() {
  FilmOutputs outputs;
  outputs.Add(Aov::kUv);  // Its channels come before those of the groups.
  outputs.light_groups = {"key", "rim"};
  return outputs;
}

FilmTile Accumulate(SampleBlock block, const FilmOutputs& outputs = {}) {
  FilmTile tile(kRect, block, outputs);
  LightPassAccumulator film(&tile);
  for (uint64_t pass = block.first; pass < block.End(); ++pass) {
    for (const Splat& s : SplatsOf(pass)) {
      film.Add(s.x, s.y, s.value, s.weight,
               outputs.empty() ? std::nullopt : std::optional<size_t>(s.group));
    }
    film.EndPass();
  }
  film.Finish();
  return tile;
}

// The sum of a pass on a pixel, splat by splat.
double PassSum(uint64_t pass, int32_t x, int32_t y, size_t component) {
  double sum = 0;
  for (const Splat& s : SplatsOf(pass)) {
    if (s.x != x || s.y != y) continue;
    sum = DoubleFloat::Round(sum + double{s.value[component]} * double{s.weight});
  }
  return sum;
}

FilmTile RootOf(const std::vector<SampleBlock>& blocks, const FilmOutputs& outputs = {}) {
  TileTree tree(kRect);
  for (const SampleBlock& block : blocks) EXPECT_TRUE(tree.Insert(Accumulate(block, outputs)).ok());
  return tree.Root();
}

TEST(LightPassAccumulatorTest, APassIsTheSumOfItsSplatsInTheirOrder) {
  const FilmTile tile = Accumulate({5, 1});
  size_t p = 0;
  bool has_light = false;
  for (int32_t y = kRect.y0; y < kRect.y1; ++y) {
    for (int32_t x = kRect.x0; x < kRect.x1; ++x, ++p) {
      const DoubleFloat red{tile.channel(FilmChannel::kRedHi)[p],
                            tile.channel(FilmChannel::kRedLo)[p]};
      EXPECT_EQ(red.Value(), PassSum(5, x, y, 0));
      EXPECT_EQ(tile.replicate(0, 2)[p], static_cast<float>(PassSum(5, x, y, 2)));
      EXPECT_EQ(tile.replicate(0, 3)[p], 1);
      EXPECT_EQ(tile.channel(FilmChannel::kWeight)[p], 1);
      EXPECT_EQ(tile.channel(FilmChannel::kSampleCount)[p], 1);
      EXPECT_EQ(tile.channel(FilmChannel::kAlpha)[p], 0);
      has_light |= red.hi != 0;
    }
  }
  EXPECT_TRUE(has_light);
  EXPECT_EQ(tile.replicate_first(), 5u);
}

// As for camera samples: however passes are cut into tasks, and in whatever order these arrive.
TEST(LightPassAccumulatorTest, AnyCutsInAnyOrderGiveTheSameBits) {
  std::mt19937 bits(7);
  for (const FilmOutputs& outputs : {FilmOutputs{}, TwoGroups()}) {
    for (const uint64_t count : {1, 3, 8, 16, 21, 40}) {
      const FilmTile expected = RootOf(CutSamples(0, count, 1), outputs);
      for (const uint64_t block_max : {2, 4, 16}) {
        std::vector<SampleBlock> blocks = CutSamples(0, count, block_max);
        std::shuffle(blocks.begin(), blocks.end(), bits);
        const FilmTile root = RootOf(blocks, outputs);
        EXPECT_TRUE(SameBits(root, expected)) << count << " passes by " << block_max;
        EXPECT_EQ(root, expected);  // Also the groups.
      }
    }
  }
}

TEST(LightPassAccumulatorTest, GroupsSumToTheImage) {
  const FilmTile tile = Accumulate({0, 4}, TwoGroups());
  const size_t uv = 2;
  ASSERT_EQ(tile.mean_count(), uv + 6);
  for (size_t p = 0; p < tile.plane_size(); ++p) {
    EXPECT_EQ(tile.mean(0, 0)[p], 0);
    const double groups = double{tile.mean(uv, 0)[p]} + double{tile.mean(uv + 3, 0)[p]};
    EXPECT_NEAR(groups, tile.channel(FilmChannel::kRedHi)[p],
                1e-6 * std::max(1.0f, std::fabs(tile.channel(FilmChannel::kRedHi)[p])));
  }
}

TEST(LightPassAccumulatorTest, WhatIsNotFiniteIsCountedAndDropped) {
  FilmTile tile(kRect, {0, 1});
  LightPassAccumulator film(&tile);
  film.Add(3, 2, {1, 2, 3}, 1, std::nullopt);
  film.Add(3, 2, {1, kInfinity, 3}, 1, std::nullopt);
  film.Add(3, 2, {std::nanf(""), 0, 0}, 0.5f, std::nullopt);
  film.Add(4, 2, {0, 0, 1e30f}, 1, std::nullopt);
  film.Add(4, 2, {0, 0, 1e30f}, 1, std::nullopt);      // The sum would be too large.
  film.Add(0, 0, {kInfinity, 0, 0}, 1, std::nullopt);  // Outside.
  film.CountLost();
  film.EndPass();
  film.Finish();
  const float* nonfinite = tile.channel(FilmChannel::kNonFiniteCount);
  const size_t p = kRect.IndexOf(3, 2), q = kRect.IndexOf(4, 2);
  EXPECT_EQ(nonfinite[p], 2);
  EXPECT_EQ(nonfinite[q], 1);
  EXPECT_EQ(nonfinite[0], 1);
  EXPECT_EQ(tile.channel(FilmChannel::kRedHi)[p], 1);
  EXPECT_EQ(tile.channel(FilmChannel::kBlueHi)[p], 3);
  EXPECT_EQ(tile.channel(FilmChannel::kBlueHi)[q], 1e30f);
  EXPECT_EQ(tile.channel(FilmChannel::kSampleCount)[p], 1);
}

TEST(LightPassAccumulatorTest, SumsTheBiasOfAllPassesAndOfEvenOnes) {
  FilmOutputs outputs = TwoGroups();
  AddMergeBias(&outputs);
  FilmTile tile(kRect, {4, 4}, outputs);
  LightPassAccumulator film(&tile);
  for (uint64_t pass = 4; pass < 8; ++pass) {
    film.Add(3, 2, {1, 1, 1}, 1, size_t{1});
    film.AddBias(3, 2, {static_cast<float>(pass), 0, 1});
    film.AddBias(3, 2, {1, 0, 0});
    film.AddBias(99, 2, {1, 1, 1});
    film.AddBias(3, 3, {kInfinity, 0, 0});
    film.EndPass();
  }
  film.Finish();
  const size_t p = kRect.IndexOf(3, 2), first = tile.mean_count() - kMergeBiasMeanCount;
  EXPECT_EQ(tile.mean(first, 0)[p], 4 + 5 + 6 + 7 + 4);
  EXPECT_EQ(tile.mean(first + 2, 0)[p], 4);
  EXPECT_EQ(tile.mean(first + 3, 0)[p], 4 + 6 + 2);
  EXPECT_EQ(tile.mean(first + 5, 0)[p], 2);
  EXPECT_EQ(tile.mean(first, 0)[kRect.IndexOf(3, 3)], 0);
  EXPECT_EQ(tile.mean(first - 1, 0)[p], 4) << "the light groups come before";
  EXPECT_EQ(tile.channel(FilmChannel::kRedHi)[p], 4);
}

}  // namespace
}  // namespace sheaf
