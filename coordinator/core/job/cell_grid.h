// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CellGrid: a frame's tiles and their cells (tile_cells.h). A tile is the unit that a worker
// renders; a cell is the unit that has its own number of samples. If samples are distributed by
// error, small cells need fewer samples in total, but tiles of that size would produce too many
// parts (docs/adr/0042). In other frames each tile is one cell.
//
// A frame with light passes has one more tile after those of the camera, the light tile
// (task_kind.h): the whole window, and one cell. A guided frame has a training tile after all of
// those. It is not part of the image and has one task, the frame's training.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/film/task_kind.h"
#include "common/film/tile_cells.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// The smallest edge of cells; cells are larger in frames that would have more than kCellsEnough.
inline constexpr int32_t kCellSizePxMin = 4;
inline constexpr int64_t kCellsEnough = 4096;

// Whether a tile can be divided into squares of this edge.
constexpr bool DividesIntoCells(int32_t tile_size_px, int32_t cell_size_px) {
  if (cell_size_px < 1 || tile_size_px % cell_size_px != 0) return false;
  const int64_t edge = tile_size_px / cell_size_px;
  return edge * edge <= kTileCellsMax;
}
// Chooses the edge of cells for a frame whose samples are distributed by error: tile_size_px, or a
// multiple of kCellSizePxMin that divides it. Depends only on its arguments, so that the image is
// reproducible.
int32_t ChooseCellSize(const PixelRect& window, int32_t tile_size_px);
// The edge of a frame's tiles: a stereo frame has one, since paths of each eye reach pixels of
// both.
int32_t TileSizeOf(const FrameSpec& frame, const Partition& partition);
// The edge of a frame's cells; the edge of its tiles if its samples are not distributed by error.
int32_t CellSizeOf(const FrameSpec& frame, const Partition& partition);

// Whether the frame has light passes. A frame of a few pixels (PixelLattice) has none: a pass
// reaches all pixels and costs as much as all. Its image lacks the light that light paths would
// find.
inline bool HasLightPasses(const FrameSettings& settings) {
  return HasLightPaths(settings.techniques) && settings.lattice.All();
}

class CellGrid {
 public:
  // Requires: window not empty; tile_size_px a multiple of cell_size_px, with at most kTileCellsMax
  // cells in a tile.
  CellGrid(const PixelRect& window, int32_t tile_size_px, int32_t cell_size_px,
           bool has_light_tile = false, bool has_training_tile = false);
  CellGrid(const FrameSpec& frame, const Partition& partition)
      : CellGrid(frame.settings.window, TileSizeOf(frame, partition), CellSizeOf(frame, partition),
                 HasLightPasses(frame.settings), NeedsTraining(frame.settings.techniques)) {}

  int32_t tile_size_px() const { return tile_size_px_; }
  int32_t cell_size_px() const { return cell_size_px_; }
  // The tiles of the camera; they divide the image. Excludes the light tile.
  const std::vector<PixelRect>& tiles() const { return tiles_; }
  // Those of tiles(), ordered by tile, and row by row within a tile.
  const std::vector<PixelRect>& cells() const { return cells_; }

  // The number of tiles of the image, including the light tile, which is the last one. The same for
  // cells.
  uint32_t tile_count() const { return all_tile_count() - (has_training_tile_ ? 1 : 0); }
  uint32_t total_cell_count() const { return first_cells_[tile_count()]; }
  // Includes the training tile, as do the numbers of tiles and cells below.
  uint32_t all_tile_count() const { return static_cast<uint32_t>(first_cells_.size()) - 1; }
  std::optional<uint32_t> light_tile() const;
  std::optional<uint32_t> training_tile() const;
  TaskKind KindOf(uint32_t tile) const {
    if (tile < tiles_.size()) return TaskKind::kCamera;
    return tile < tile_count() ? TaskKind::kLight : TaskKind::kTraining;
  }
  const PixelRect& RectOf(uint32_t tile) const {
    return tile < tiles_.size() ? tiles_[tile] : window_;
  }
  std::span<const PixelRect> CellRectsOf(uint32_t tile) const;
  // The number of a tile's first cell; the cells of a tile are numbered consecutively.
  uint32_t first_cell(uint32_t tile) const { return first_cells_[tile]; }
  uint32_t cell_count(uint32_t tile) const { return first_cells_[tile + 1] - first_cells_[tile]; }
  uint32_t TileOf(uint32_t cell) const;
  // The mask of all cells of a tile.
  uint64_t AllOf(uint32_t tile) const { return ~uint64_t{0} >> (64 - cell_count(tile)); }

  std::optional<uint32_t> FindTile(const PixelRect& rect, TaskKind kind = TaskKind::kCamera) const;
  // Returns the mask of these cells of the tile; none if the grid does not have such cells.
  std::optional<uint64_t> MaskOf(uint32_t tile, const TileCells& cells) const;
  // Inverse of MaskOf. Requires: a mask that is not empty and has no bits outside AllOf.
  TileCells CellsOf(uint32_t tile, uint64_t mask) const;
  // Distributes the value of each of tiles() among its cells in proportion to their weights.
  // Requires: weights above 0.
  std::vector<double> Distribute(std::span<const double> of_tiles,
                                 std::span<const double> weights) const;

 private:
  PixelRect window_;
  int32_t tile_size_px_, cell_size_px_;
  std::vector<PixelRect> tiles_, cells_;  // Tiles row by row.
  std::vector<uint32_t> first_cells_;     // One more than there are tiles of all kinds.
  bool has_training_tile_;
};

}  // namespace sheaf::coordinator
