// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/tile_cells.h"

#include <gtest/gtest.h>

#include "common/film/film_test_samples.h"

namespace sheaf {
namespace {

// Cells of 8 px: 4 columns of 4, 8, 8 and 2 px and 2 rows.
constexpr PixelRect kCellsTile{12, 8, 34, 20};

TEST(TileCellsTest, ChosenCellsAreRectanglesInRowOrder) {
  EXPECT_EQ(RectsOf(kCellsTile, {}), std::vector<PixelRect>{kCellsTile});
  const std::vector<PixelRect> rects = RectsOf(kCellsTile, {8, 0b10001001});
  ASSERT_EQ(rects.size(), 3u);
  EXPECT_EQ(rects[0], (PixelRect{12, 8, 16, 16}));
  EXPECT_EQ(rects[1], (PixelRect{32, 8, 34, 16}));
  EXPECT_EQ(rects[2], (PixelRect{32, 16, 34, 20}));
}

TEST(TileCellsTest, CellsOutsideTheTileAreDetected) {
  EXPECT_EQ(WhyNoCells(kCellsTile, {}), "");
  EXPECT_EQ(WhyNoCells(kCellsTile, {8, 0b10001001}), "");
  EXPECT_NE(WhyNoCells(kCellsTile, {8, 0}), "");
  EXPECT_NE(WhyNoCells(kCellsTile, {0, 1}), "");
  EXPECT_NE(WhyNoCells(kCellsTile, {-8, 1}), "");
  EXPECT_NE(WhyNoCells(kCellsTile, {8, 1 << 8}), "");
  EXPECT_NE(WhyNoCells(kCellsTile, {8, 0b11111111}), "") << "all of them have one name, not two";
  EXPECT_NE(WhyNoCells(kCellsTile, {2, 1}), "") << "66 cells";
  EXPECT_NE(WhyNoCells({0, 0, 1 << 20, 1 << 20}, {1, 1}), "") << "before memory is taken for them";
  EXPECT_EQ(WhyNoCells({0, 0, 64, 64}, {8, ~uint64_t{0} - 1}), "");
  EXPECT_NE(WhyNoCells({0, 0, 64, 64}, {8, ~uint64_t{0}}), "");
}

TEST(TileCellsTest, ExtractedPixelsEqualTheTile) {
  for (const SampleBlock block : {SampleBlock{0, 1}, {4, 4}, {16, 16}, {32, 32}}) {
    const FilmTile tile = MakeTestTile(kCellsTile, block);
    FilmTile whole(kCellsTile, block);
    for (const PixelRect& rect : CutTiles(kCellsTile, 8)) {
      const FilmTile cell = CutOut(tile, rect);
      EXPECT_TRUE(SameBits(cell, MakeTestTile(rect, block)));
      Paste(cell, &whole);
    }
    EXPECT_TRUE(SameBits(whole, tile));
  }
}

TEST(TileCellsTest, PixelsWithFewerSamplesKeepTheirReplicates) {
  constexpr PixelRect kCell{16, 8, 24, 16};
  FilmTile whole(kCellsTile, {0, 32});
  Paste(MakeTestTile(kCell, {0, 4}), &whole);
  const FilmTile cell = CutOut(whole, kCell);
  const FilmTile alone = MakeTestTile(kCell, {0, 4});
  for (uint32_t slot = 0; slot < kReplicateCount; ++slot) {
    for (size_t p = 0; p < cell.plane_size(); ++p) {
      EXPECT_EQ(cell.replicate(slot, 0)[p], slot < 4 ? alone.replicate(slot, 0)[p] : 0);
    }
  }
}

TEST(TileCellsTest, OutputsAndIdsFollowTheirPixels) {
  FilmOutputs outputs;
  outputs.AddLightPaths();
  FilmTile tile(kCellsTile, {0, 16}, outputs);
  for (size_t i = 0; i < tile.mean_count(); ++i) {
    for (size_t p = 0; p < tile.plane_size(); ++p) {
      tile.mean(i, 0)[p] = static_cast<float>(i * 1000 + p);
      tile.mean(i, 1)[p] = -static_cast<float>(p);
    }
  }
  ASSERT_GT(tile.mean_count(), 0u);
  FilmTile whole(kCellsTile, {0, 16}, outputs);
  for (const PixelRect& rect : CutTiles(kCellsTile, 8)) Paste(CutOut(tile, rect), &whole);
  EXPECT_EQ(whole, tile);
}

}  // namespace
}  // namespace sheaf
