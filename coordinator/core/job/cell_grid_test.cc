// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/cell_grid.h"

#include <gtest/gtest.h>

namespace sheaf::coordinator {
namespace {

TEST(CellGridTest, CellSizeGrowsWithTheFrame) {
  EXPECT_EQ(ChooseCellSize({0, 0, 200, 150}, 32), 4);
  EXPECT_EQ(ChooseCellSize({0, 0, 256, 256}, 32), 4);
  EXPECT_EQ(ChooseCellSize({0, 0, 260, 256}, 32), 8);
  EXPECT_EQ(ChooseCellSize({0, 0, 1024, 576}, 32), 16);
  EXPECT_EQ(ChooseCellSize({0, 0, 1920, 1080}, 32), 32);
  // A cell size must divide the tile size, with at most 8 cells along an edge.
  EXPECT_EQ(ChooseCellSize({0, 0, 100, 100}, 41), 41);
  EXPECT_EQ(ChooseCellSize({0, 0, 100, 100}, 128), 16);
  EXPECT_EQ(ChooseCellSize({0, 0, 100, 100}, 4), 4);
  EXPECT_EQ(ChooseCellSize({0, 0, 100, 100}, 1), 1);
}

TEST(CellGridTest, UniformFramesHaveOneCellPerTile) {
  const Partition partition{32, 16, 0, 8};
  FrameSpec frame;
  EXPECT_EQ(CellSizeOf(frame, partition), 32);
  frame.stop.target_error = 0.1;
  EXPECT_EQ(CellSizeOf(frame, partition), 8);
  EXPECT_EQ(CellSizeOf(frame, {32, 16, 0, 0}), 32) << "a job of an earlier version";
  frame.stop = {};
  frame.resumed.sha256_hex = "a";
  EXPECT_EQ(CellSizeOf(frame, partition), 8);
}

TEST(CellGridTest, CellsAreNumberedByTile) {
  const CellGrid grid({4, 0, 40, 20}, 32, 16);
  ASSERT_EQ(grid.tiles().size(), 2u);
  ASSERT_EQ(grid.cells().size(), 6u);
  EXPECT_EQ(grid.first_cell(0), 0u);
  EXPECT_EQ(grid.cell_count(0), 4u);
  EXPECT_EQ(grid.first_cell(1), 4u);
  EXPECT_EQ(grid.cell_count(1), 2u);
  EXPECT_EQ(grid.AllOf(0), 0b1111u);
  EXPECT_EQ(grid.AllOf(1), 0b11u);
  EXPECT_EQ(grid.cells()[1], (PixelRect{16, 0, 32, 16}));
  EXPECT_EQ(grid.cells()[5], (PixelRect{32, 16, 40, 20}));
  for (uint32_t cell = 0; cell < 6; ++cell) EXPECT_EQ(grid.TileOf(cell), cell < 4 ? 0u : 1u);
  EXPECT_EQ(grid.FindTile({32, 0, 40, 20}), 1u);
  EXPECT_EQ(grid.FindTile({32, 0, 40, 19}), std::nullopt);
}

TEST(CellGridTest, MasksHaveUniqueNames) {
  const CellGrid grid({0, 0, 64, 64}, 64, 8);
  EXPECT_EQ(grid.AllOf(0), ~uint64_t{0});
  EXPECT_TRUE(grid.CellsOf(0, grid.AllOf(0)).All());
  for (const uint64_t mask : {uint64_t{1}, uint64_t{1} << 63, ~uint64_t{0} >> 1}) {
    EXPECT_EQ(grid.CellsOf(0, mask), (TileCells{8, mask}));
    EXPECT_EQ(grid.MaskOf(0, {8, mask}), mask);
  }
  EXPECT_EQ(grid.MaskOf(0, {}), grid.AllOf(0));
  EXPECT_EQ(grid.MaskOf(0, {16, 1}), std::nullopt);
  EXPECT_EQ(grid.MaskOf(0, {8, 0}), std::nullopt);
  EXPECT_EQ(CellGrid({0, 0, 64, 64}, 32, 32).MaskOf(0, {16, 1}), std::nullopt);
}

TEST(CellGridTest, DistributesTilesByWeight) {
  const CellGrid grid({4, 0, 40, 20}, 32, 16);
  const std::vector<double> tiles = {10, 3}, weights = {1, 2, 3, 4, 5, 1};
  EXPECT_EQ(grid.Distribute(tiles, weights), (std::vector<double>{1, 2, 3, 4, 2.5, 0.5}));
}

TEST(CellGridTest, TheLightTileIsTheLastAndTheWholeWindow) {
  const PixelRect window{0, 0, 40, 20};
  const CellGrid plain(window, 32, 8), grid(window, 32, 8, /*has_light_tile=*/true);
  EXPECT_EQ(plain.light_tile(), std::nullopt);
  EXPECT_EQ(plain.tile_count(), 2u);
  EXPECT_EQ(grid.tiles(), plain.tiles());
  EXPECT_EQ(grid.cells(), plain.cells());
  ASSERT_EQ(grid.light_tile(), 2u);
  EXPECT_EQ(grid.tile_count(), 3u);
  EXPECT_EQ(grid.total_cell_count(), plain.total_cell_count() + 1);
  EXPECT_EQ(grid.KindOf(1), TaskKind::kCamera);
  EXPECT_EQ(grid.KindOf(2), TaskKind::kLight);
  EXPECT_EQ(grid.RectOf(2), window);
  EXPECT_EQ(grid.cell_count(2), 1u);
  EXPECT_EQ(grid.TileOf(grid.first_cell(2)), 2u);
  EXPECT_EQ(grid.AllOf(2), 1u);
  EXPECT_TRUE(grid.CellsOf(2, 1).All());
  ASSERT_EQ(grid.CellRectsOf(2).size(), 1u);
  EXPECT_EQ(grid.CellRectsOf(2)[0], window);
  EXPECT_EQ(grid.CellRectsOf(1).size(), grid.cell_count(1));
}

TEST(CellGridTest, OnlyFramesWithLightPathsHaveALightTile) {
  FrameSpec frame;
  frame.settings.window = {0, 0, 40, 20};
  for (const TechniqueSet techniques :
       {TechniqueSet::kCameraAndLight, TechniqueSet::kLight, TechniqueSet::kCameraAndLightGuided}) {
    frame.settings.techniques = techniques;
    EXPECT_EQ(CellGrid(frame, Partition()).light_tile(), 2u) << techniques.Name();
  }
  for (const TechniqueSet techniques : {TechniqueSet::kCamera, TechniqueSet::kCameraGuided}) {
    frame.settings.techniques = techniques;
    const CellGrid grid(frame, Partition());
    EXPECT_EQ(grid.light_tile(), std::nullopt) << techniques.Name();
    EXPECT_EQ(grid.tile_count(), 2u) << techniques.Name();
  }
}

TEST(CellGridTest, TheTrainingTileIsNoTileOfTheImage) {
  const PixelRect window{0, 0, 40, 20};
  for (const bool has_light : {false, true}) {
    const CellGrid plain(window, 32, 8, has_light);
    const CellGrid grid(window, 32, 8, has_light, /*has_training_tile=*/true);
    EXPECT_EQ(plain.training_tile(), std::nullopt);
    EXPECT_EQ(plain.all_tile_count(), plain.tile_count());
    EXPECT_EQ(grid.tile_count(), plain.tile_count());
    EXPECT_EQ(grid.light_tile(), plain.light_tile());
    EXPECT_EQ(grid.total_cell_count(), plain.total_cell_count());
    ASSERT_EQ(grid.training_tile(), plain.tile_count());
    const uint32_t tile = *grid.training_tile();
    EXPECT_EQ(grid.all_tile_count(), tile + 1);
    EXPECT_EQ(grid.KindOf(tile), TaskKind::kTraining);
    EXPECT_EQ(grid.KindOf(tile - 1), has_light ? TaskKind::kLight : TaskKind::kCamera);
    EXPECT_EQ(grid.RectOf(tile), window);
    EXPECT_EQ(grid.AllOf(tile), 1u);
    EXPECT_TRUE(grid.CellsOf(tile, 1).All());
    EXPECT_EQ(grid.FindTile(window, TaskKind::kTraining), tile);
    EXPECT_EQ(grid.FindTile({0, 0, 32, 20}, TaskKind::kTraining), std::nullopt);
    EXPECT_EQ(plain.FindTile(window, TaskKind::kTraining), std::nullopt);
  }
}

TEST(CellGridTest, AFrameThatSharesPathsHasOneTile) {
  for (const bool is_stereo : {false, true}) {
    FrameSpec frame;
    frame.settings.width_px = 640;
    frame.settings.height_px = 240;
    frame.settings.window = {0, 0, 640, 240};
    if (is_stereo) {
      frame.settings.eye_distance = 0.1f;
    } else {
      frame.settings.techniques = TechniqueSet{Technique::kSharing};
    }
    frame.stop.target_error = 0.01;
    Partition partition;
    partition.cell_size_px = 4;
    const CellGrid grid(frame, partition);
    ASSERT_EQ(grid.tiles().size(), 1u);
    EXPECT_EQ(grid.tiles()[0], frame.settings.window);
    EXPECT_EQ(grid.cells().size(), 1u);
    EXPECT_EQ(grid.FindTile(frame.settings.window), 0u);
  }
}

}  // namespace
}  // namespace sheaf::coordinator
