// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CellGrid: a frame's tiles and their cells (tile_cells.h). A tile is what a worker renders, a cell
// what has a count of samples of its own: where samples go where they are needed, small cells need
// fewer, and tiles as small would drown the farm in parts (docs/adr/0042). In other frames each
// tile is one cell.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/film/tile_cells.h"
#include "coordinator/core/job.h"

namespace sheaf::coordinator {

// Cells are as small as this, and larger in frames that would have more than so many.
inline constexpr int32_t kCellSizePxMin = 4;
inline constexpr int64_t kCellsEnough = 4096;

// Whether a tile can be divided into squares of that edge.
constexpr bool DividesIntoCells(int32_t tile_size_px, int32_t cell_size_px) {
  if (cell_size_px < 1 || tile_size_px % cell_size_px != 0) return false;
  const int64_t edge = tile_size_px / cell_size_px;
  return edge * edge <= kTileCellsMax;
}
// The edge of cells in a frame that gets samples where they are needed: tile_size_px, or a part of
// it, a multiple of kCellSizePxMin. A function of its arguments, so that the image is one.
int32_t ChooseCellSize(const PixelRect& window, int32_t tile_size_px);
// The size of a frame's cells: the tile's where its samples are not distributed among cells.
int32_t CellSizeOf(const FrameSpec& frame, const Partition& partition);

class CellGrid {
 public:
  // Requires: window not empty; tile_size_px a multiple of cell_size_px, which makes at most
  // kTileCellsMax cells of a tile.
  CellGrid(const PixelRect& window, int32_t tile_size_px, int32_t cell_size_px);
  CellGrid(const FrameSpec& frame, const Partition& partition)
      : CellGrid(frame.settings.window, partition.tile_size_px, CellSizeOf(frame, partition)) {}

  int32_t tile_size_px() const { return tile_size_px_; }
  int32_t cell_size_px() const { return cell_size_px_; }
  const std::vector<PixelRect>& tiles() const { return tiles_; }
  // Tile after tile, within a tile row by row.
  const std::vector<PixelRect>& cells() const { return cells_; }
  // A tile's cells have numbers from first_cell on.
  uint32_t first_cell(uint32_t tile) const { return first_cells_[tile]; }
  uint32_t cell_count(uint32_t tile) const { return first_cells_[tile + 1] - first_cells_[tile]; }
  uint32_t TileOf(uint32_t cell) const;
  // The mask of all of them.
  uint64_t AllOf(uint32_t tile) const { return ~uint64_t{0} >> (64 - cell_count(tile)); }

  std::optional<uint32_t> FindTile(const PixelRect& rect) const;
  // None where the grid has no such cells.
  std::optional<uint64_t> MaskOf(uint32_t tile, const TileCells& cells) const;
  // The same as others name it. Requires: mask has bits, and no others than AllOf.
  TileCells CellsOf(uint32_t tile, uint64_t mask) const;
  // Distributes each tile's value among its cells by their weights. Requires: weights above 0.
  std::vector<double> Distribute(std::span<const double> of_tiles,
                                 std::span<const double> weights) const;

 private:
  int32_t tile_size_px_, cell_size_px_;
  std::vector<PixelRect> tiles_, cells_;  // Tiles row by row.
  std::vector<uint32_t> first_cells_;     // One more than tiles.
};

}  // namespace sheaf::coordinator
