// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/tile_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <utility>

namespace sheaf {
namespace {

TEST(PixelRectTest, ContainsIntersectsAndIsEmpty) {
  constexpr PixelRect rect{2, 3, 10, 8};
  EXPECT_TRUE(rect.Contains(rect));
  EXPECT_TRUE(rect.Contains({2, 7, 3, 8}));
  EXPECT_FALSE(rect.Contains({1, 3, 10, 8}));
  EXPECT_FALSE(rect.Contains({2, 3, 10, 9}));
  EXPECT_EQ(Intersect(rect, {0, 5, 4, 99}), (PixelRect{2, 5, 4, 8}));
  EXPECT_TRUE(Intersect(rect, {10, 3, 12, 8}).IsEmpty());
  EXPECT_TRUE((PixelRect{2, 3, 10, 3}.IsEmpty()));
  EXPECT_FALSE(rect.IsEmpty());
}

TEST(TileGeometryTest, BlocksHaveParentsAndSiblings) {
  EXPECT_TRUE(IsAligned({0, 1}));
  EXPECT_TRUE(IsAligned({24, 8}));
  EXPECT_FALSE(IsAligned({24, 16}));
  EXPECT_FALSE(IsAligned({0, 0}));
  EXPECT_FALSE(IsAligned({0, 6}));
  EXPECT_FALSE(IsAligned({uint64_t{1} << 63, uint64_t{1} << 63}));
  EXPECT_EQ(Sibling({24, 8}), (SampleBlock{16, 8}));
  EXPECT_EQ(Sibling({16, 8}), (SampleBlock{24, 8}));
  EXPECT_EQ(Parent({24, 8}), (SampleBlock{16, 16}));
  EXPECT_TRUE(Contains({16, 16}, {24, 8}));
  EXPECT_FALSE(Contains({24, 8}, {16, 16}));
}

TEST(TileGeometryTest, CutSamplesCoversTheRangeWithAlignedBlocks) {
  const uint64_t far = uint64_t{1} << 40;
  for (const uint64_t first : {uint64_t{0}, uint64_t{1}, uint64_t{5}, uint64_t{48}, far, far + 3}) {
    for (const uint64_t count : {0, 1, 2, 7, 16, 100, 1000}) {
      for (const uint64_t block_max : {1, 4, 64, 4096}) {
        uint64_t next = first;
        for (const SampleBlock& block : CutSamples(first, count, block_max)) {
          ASSERT_TRUE(IsAligned(block));
          ASSERT_EQ(block.first, next);
          ASSERT_LE(block.count, block_max);
          next = block.End();
        }
        ASSERT_EQ(next, first + count);
      }
    }
  }
}

TEST(TileGeometryTest, CutSamplesUsesTheFewestBlocks) {
  EXPECT_EQ(CutSamples(0, 100, 64), (std::vector<SampleBlock>{{0, 64}, {64, 32}, {96, 4}}));
  EXPECT_EQ(CutSamples(3, 6, 64), (std::vector<SampleBlock>{{3, 1}, {4, 4}, {8, 1}}));
  EXPECT_EQ(CutSamples(0, 64, 16).size(), 4u);
}

TEST(TileGeometryTest, CutTilesCoversEveryPixelOnceAlignedToTheFrame) {
  for (const PixelRect frame :
       {PixelRect{0, 0, 100, 70}, {13, 5, 14, 6}, {-20, -3, 40, 33}, {16, 32, 48, 64}}) {
    std::set<std::pair<int32_t, int32_t>> seen;
    for (const PixelRect& tile : CutTiles(frame, 16)) {
      EXPECT_TRUE(tile.x0 == frame.x0 || tile.x0 % 16 == 0);
      EXPECT_TRUE(tile.y1 == frame.y1 || tile.y1 % 16 == 0);
      for (int32_t y = tile.y0; y < tile.y1; ++y) {
        for (int32_t x = tile.x0; x < tile.x1; ++x) EXPECT_TRUE(seen.insert({x, y}).second);
      }
    }
    EXPECT_EQ(static_cast<int64_t>(seen.size()), frame.PixelCount());
  }
  EXPECT_TRUE(CutTiles({5, 5, 5, 9}, 16).empty());
  EXPECT_EQ(CutTiles({0, 0, 33, 17}, 16).size(), 6u);
}

}  // namespace
}  // namespace sheaf
