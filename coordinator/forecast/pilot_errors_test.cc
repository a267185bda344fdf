// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/pilot_errors.h"

#include <cmath>
#include <random>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

// 8 x 8 tiles of 16 cells each.
const CellGrid& Grid() {
  static const CellGrid grid({0, 0, 256, 256}, 32, 8);
  return grid;
}

PilotBlock BlockOf(size_t cell, double error) { return {cell, {9, 9 * error, 9 * error * error}}; }

double MeanOf(const std::vector<double>& errors, uint32_t first, uint32_t count) {
  double sum = 0;
  for (uint32_t i = first; i < first + count; ++i) sum += errors[i];
  return sum / count;
}

// Two cells of each tile have a block with the tile's error.
std::vector<PilotBlock> BlocksOf(const std::vector<double>& errors_of_tiles) {
  std::vector<PilotBlock> blocks;
  for (uint32_t tile = 0; tile < errors_of_tiles.size(); ++tile) {
    for (const uint32_t cell : {tile % 16, (tile + 5) % 16}) {
      blocks.push_back(BlockOf(Grid().first_cell(tile) + cell, errors_of_tiles[tile]));
    }
  }
  return blocks;
}

// Most cells have no block; their errors must follow those of their tile.
TEST(PilotErrorsTest, CellsWithoutBlocksUseTheirTile) {
  std::vector<double> tiles(Grid().tiles().size());
  for (size_t i = 0; i < tiles.size(); ++i) tiles[i] = i % 3 == 0 ? 0.2 : 0.02;
  const PilotErrors errors = FitCellErrors(Grid(), BlocksOf(tiles));
  double high = 0, low = 0;
  for (uint32_t tile = 0; tile < tiles.size(); ++tile) {
    const double mean = MeanOf(errors.of_cells, Grid().first_cell(tile), Grid().cell_count(tile));
    (tile % 3 == 0 ? high : low) += mean / (tile % 3 == 0 ? 22 : 42);
  }
  EXPECT_GT(high / low, 5);
  EXPECT_LT(high / low, 12);
}

TEST(PilotErrorsTest, FrameErrorIsTheBlockMean) {
  std::mt19937_64 random(1);
  std::lognormal_distribution<double> error(-3, 1);
  std::vector<PilotBlock> blocks;
  double sum = 0;
  for (size_t cell = 3; cell < Grid().cells().size(); cell += 7) {
    blocks.push_back(BlockOf(cell, error(random)));
    sum += blocks.back().error.RelativeMse();
  }
  const PilotErrors errors = FitCellErrors(Grid(), blocks);
  EXPECT_NEAR(MeanOf(errors.of_cells, 0, 1024), sum / static_cast<double>(blocks.size()), 1e-12);
}

// If half of a frame has no error, such as a sky, the cells of the other half must not be assumed
// to vary by many orders of magnitude. The saving of distributed samples depends on the mean of the
// square roots of errors, here .71 of the root of the mean.
TEST(PilotErrorsTest, ErrorFreeBlocksDoNotAddSpread) {
  std::vector<double> tiles(Grid().tiles().size());
  for (size_t i = 0; i < tiles.size(); ++i) tiles[i] = i < 32 ? 0 : 0.1;
  const PilotErrors errors = FitCellErrors(Grid(), BlocksOf(tiles));
  double mean = 0, mean_root = 0;
  for (const double error : errors.of_cells) {
    mean += error / 1024;
    mean_root += std::sqrt(error) / 1024;
  }
  EXPECT_NEAR(mean_root / std::sqrt(mean), 0.71, 0.12);
}

TEST(PilotErrorsTest, SingleBlocksAreResampled) {
  const PilotErrors errors = FitCellErrors(Grid(), std::vector{BlockOf(500, 0.3)});
  EXPECT_NEAR(MeanOf(errors.of_cells, 0, 1024), 0.3, 1e-9);
  double squares = 0;
  for (const double error : errors.of_cells) squares += std::pow(std::log(error), 2) / 1024;
  EXPECT_GT(squares, 0.5);
}

}  // namespace
}  // namespace sheaf::coordinator
