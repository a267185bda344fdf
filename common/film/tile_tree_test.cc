// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/tile_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "common/film/film_test_samples.h"
#include "common/math/double_float.h"

namespace sheaf {
namespace {

constexpr PixelRect kTreeRect{0, 0, 2, 2};

// The canonical tree over the samples before `end`: a parent without a right half equals its left
// one.
DoubleFloat RedOfPrefix(SampleBlock block, uint64_t end) {
  if (block.count == 1) {
    const FilmSample s = MakeTestSample(0, 0, block.first);
    return DoubleFloat::Make(double{s.radiance.r} * s.filter_weight);
  }
  const SampleBlock left{block.first, block.count / 2}, right = Sibling(left);
  if (right.first >= end) return RedOfPrefix(left, end);
  return Add(RedOfPrefix(left, end), RedOfPrefix(right, end));
}

// A random way to cut [0, count) into aligned blocks.
std::vector<SampleBlock> CutAtRandom(uint64_t count, std::mt19937* bits) {
  std::vector<SampleBlock> pending = CutSamples(0, count, 1 << 20), blocks;
  while (!pending.empty()) {
    const SampleBlock block = pending.back();
    pending.pop_back();
    if (block.count > 1 && (*bits)() % 3 != 0) {
      pending.push_back({block.first, block.count / 2});
      pending.push_back({block.first + block.count / 2, block.count / 2});
    } else {
      blocks.push_back(block);
    }
  }
  std::shuffle(blocks.begin(), blocks.end(), *bits);
  return blocks;
}

FilmTile RootOf(const std::vector<SampleBlock>& blocks) {
  TileTree tree(kTreeRect);
  for (const SampleBlock& block : blocks)
    EXPECT_TRUE(tree.Insert(MakeTestTile(kTreeRect, block)).ok());
  return tree.Root();
}

TEST(TileTreeTest, AnyPartitionInAnyOrderGivesTheSameBits) {
  constexpr int kCutsEach = 12;
  std::mt19937 bits(2024);
  for (const uint64_t count :
       {1, 2, 3, 5, 7, 8, 15, 16, 17, 21, 24, 31, 33, 48, 64, 100, 129, 200}) {
    const FilmTile expected = RootOf(CutSamples(0, count, 1 << 20));
    const DoubleFloat red{expected.channel(FilmChannel::kRedHi)[0],
                          expected.channel(FilmChannel::kRedLo)[0]};
    EXPECT_EQ(red, RedOfPrefix({0, 1024}, count)) << count;
    for (int i = 0; i < kCutsEach; ++i) {
      EXPECT_TRUE(SameBits(RootOf(CutAtRandom(count, &bits)), expected))
          << count << " samples, cut " << i;
    }
  }
}

TEST(TileTreeTest, MergesSiblingsAtOnce) {
  TileTree tree(kTreeRect);
  for (const uint64_t first : {3, 1, 2, 0})
    ASSERT_TRUE(tree.Insert(MakeTestTile(kTreeRect, {first, 1})).ok());
  ASSERT_EQ(tree.nodes().size(), 1u);
  EXPECT_EQ(tree.nodes().at(0).block(), (SampleBlock{0, 4}));
  ASSERT_TRUE(tree.Insert(MakeTestTile(kTreeRect, {8, 4})).ok());
  EXPECT_EQ(tree.nodes().size(), 2u);
  EXPECT_EQ(tree.SampleCount(), 8u);
  EXPECT_TRUE(tree.Covers({2, 2}));
  EXPECT_TRUE(tree.Covers({8, 4}));
  EXPECT_FALSE(tree.Covers({0, 8}));
  EXPECT_FALSE(tree.Covers({4, 1}));
  ASSERT_TRUE(tree.Insert(MakeTestTile(kTreeRect, {4, 4})).ok());
  EXPECT_EQ(tree.nodes().size(), 2u);  // [0, 8) and [8, 12).
  ASSERT_TRUE(tree.Insert(MakeTestTile(kTreeRect, {12, 4})).ok());
  EXPECT_TRUE(tree.Covers({0, 16}));
  EXPECT_TRUE(SameBits(tree.Root(), MakeTestTile(kTreeRect, {0, 16})));
}

TEST(TileTreeTest, RefusesDuplicatesOverlapsAndForeignBlocks) {
  TileTree tree(kTreeRect);
  ASSERT_TRUE(tree.Insert(MakeTestTile(kTreeRect, {8, 8})).ok());
  EXPECT_EQ(tree.Insert(MakeTestTile(kTreeRect, {8, 8})).code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(tree.Insert(MakeTestTile(kTreeRect, {12, 2})).code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(tree.Insert(MakeTestTile(kTreeRect, {0, 16})).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(tree.Insert(MakeTestTile({0, 0, 1, 1}, {0, 8})).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(tree.SampleCount(), 8u);
}

TEST(TileTreeTest, PreviewSumsAvailableNodes) {
  TileTree tree(kTreeRect);
  const FilmTile a = MakeTestTile(kTreeRect, {2, 2}), b = MakeTestTile(kTreeRect, {16, 16});
  ASSERT_TRUE(tree.Insert(b).ok());
  ASSERT_TRUE(tree.Insert(a).ok());
  const FilmTile sum = tree.PreviewSum();
  EXPECT_EQ(sum.channel(FilmChannel::kSampleCount)[3], 18.0f);
  EXPECT_EQ(sum.replicate(2, 0)[3], a.replicate(0, 0)[3] + b.replicate(2, 0)[3]);
  EXPECT_EQ(sum.replicate(5, 0)[3], b.replicate(5, 0)[3]);
}

TEST(TileTreeTest, PreviewSumsThreeOrMoreNodes) {
  TileTree tree(kTreeRect);
  float samples = 0;
  for (const SampleBlock block : {SampleBlock{0, 64}, {64, 32}, {96, 4}, {128, 16}}) {
    ASSERT_TRUE(tree.Insert(MakeTestTile(kTreeRect, block)).ok());
    samples += static_cast<float>(block.count);
    EXPECT_EQ(tree.PreviewSum().channel(FilmChannel::kSampleCount)[3], samples);
  }
}

TEST(TileTreeDeathTest, RootNeedsAPrefix) {
  TileTree tree(kTreeRect);
  EXPECT_DEATH(static_cast<void>(tree.Root()), "check failed");
  ASSERT_TRUE(tree.Insert(MakeTestTile(kTreeRect, {8, 8})).ok());
  EXPECT_DEATH(static_cast<void>(tree.Root()), "check failed");
}

}  // namespace
}  // namespace sheaf
