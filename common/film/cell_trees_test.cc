// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/cell_trees.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>

#include "common/film/film_test_samples.h"
#include "common/film/tile_cells.h"

namespace sheaf {
namespace {

constexpr PixelRect kTreesTile{0, 0, 8, 8};
const std::vector<PixelRect> kCells = CutTiles(kTreesTile, 4);

// A part of a tile as a worker makes it: the other cells are empty.
FilmTile PartOf(SampleBlock block, uint64_t mask) {
  FilmTile part(kTreesTile, block);
  for (size_t i = 0; i < kCells.size(); ++i) {
    if ((mask >> i & 1) != 0) Paste(MakeTestTile(kCells[i], block), &part);
  }
  return part;
}

FilmTile RootAlone(const PixelRect& rect, uint64_t samples) {
  TileTree tree(rect);
  for (const SampleBlock& block : CutSamples(0, samples, 1 << 20)) {
    EXPECT_TRUE(tree.Insert(MakeTestTile(rect, block)).ok());
  }
  return tree.Root();
}

TEST(CellTreesTest, SingleCellEqualsATileTree) {
  CellTrees trees(kTreesTile, {&kTreesTile, 1});
  for (const SampleBlock& block : CutSamples(0, 21, 16)) {
    ASSERT_TRUE(trees.Insert(MakeTestTile(kTreesTile, block), 1).ok());
  }
  EXPECT_EQ(trees.SampleCount(0), 21u);
  EXPECT_TRUE(SameBits(trees.Root(), RootAlone(kTreesTile, 21)));
}

// Holds for any division of the cells' samples into parts, in any order of arrival.
TEST(CellTreesTest, AnyPartitionGivesTheSameBitsPerCell) {
  const uint64_t samples[] = {16, 48, 100, 21};
  std::mt19937 bits(7);
  for (int attempt = 0; attempt < 20; ++attempt) {
    std::vector<std::pair<SampleBlock, uint64_t>> parts;
    for (const uint64_t block_max : {uint64_t{4}}) {
      for (uint64_t first = 0; first < 100; first += block_max) {
        // All cells that need the block, in one part or in several.
        for (uint64_t count = block_max; count > 0; --count) {
          uint64_t mask = 0;
          for (size_t i = 0; i < kCells.size(); ++i) {
            const uint64_t left = samples[i] > first ? samples[i] - first : 0;
            if (std::min(left, block_max) == count) mask |= uint64_t{1} << i;
          }
          const uint64_t some = mask & bits();
          for (const SampleBlock& block : CutSamples(first, count, block_max)) {
            if (some != 0) parts.emplace_back(block, some);
            if ((mask & ~some) != 0) parts.emplace_back(block, mask & ~some);
          }
        }
      }
    }
    std::ranges::shuffle(parts, bits);
    CellTrees trees(kTreesTile, kCells);
    for (const auto& [block, mask] : parts) {
      ASSERT_TRUE(trees.Insert(PartOf(block, mask), mask).ok());
    }
    const FilmTile root = trees.Root();
    EXPECT_EQ(root.block(), (SampleBlock{0, 128}));
    for (size_t i = 0; i < kCells.size(); ++i) {
      EXPECT_EQ(trees.SampleCount(i), samples[i]);
      FilmTile alone(kCells[i], {0, 128});
      Paste(RootAlone(kCells[i], samples[i]), &alone);
      EXPECT_TRUE(SameBits(CutOut(root, kCells[i]), alone));
    }
  }
}

TEST(CellTreesTest, PartsOfOneCellAreKeptAsTheyAre) {
  CellTrees trees(kTreesTile, kCells);
  ASSERT_TRUE(trees.Insert(MakeTestTile(kCells[2], {0, 16}), 0b100).ok());
  EXPECT_EQ(trees.SampleCount(2), 16u);
  EXPECT_TRUE(absl::IsAlreadyExists(trees.Insert(PartOf({0, 16}, 0b100), 0b100)));
  EXPECT_TRUE(absl::IsInvalidArgument(trees.Insert(MakeTestTile({0, 0, 8, 4}, {0, 16}), 0b11)));
  // The other cells are still empty, and a preview shows what is there.
  const FilmTile preview = trees.PreviewSum();
  EXPECT_EQ(preview.rect(), kTreesTile);
  EXPECT_TRUE(SameBits(CutOut(preview, kCells[2]), MakeTestTile(kCells[2], {0, 16})));
  EXPECT_EQ(preview.channel(FilmChannel::kSampleCount)[0], 0);
}

}  // namespace
}  // namespace sheaf
