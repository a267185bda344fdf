// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/cell_grid.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "common/base/check.h"
#include "common/scene/settings/path_shares.h"

namespace sheaf::coordinator {

int32_t ChooseCellSize(const PixelRect& window, int32_t tile_size_px) {
  for (int32_t size = kCellSizePxMin; size < tile_size_px; size *= 2) {
    const int64_t columns = (window.Width() + size - 1) / size;
    const int64_t rows = (window.Height() + size - 1) / size;
    if (DividesIntoCells(tile_size_px, size) && columns * rows <= kCellsEnough) return size;
  }
  return tile_size_px;
}

int32_t TileSizeOf(const FrameSpec& frame, const Partition& partition) {
  const PixelRect& window = frame.settings.window;
  return HasOneTile(frame.settings) ? std::max(window.x1, window.y1) : partition.tile_size_px;
}

int32_t CellSizeOf(const FrameSpec& frame, const Partition& partition) {
  if (HasOneTile(frame.settings)) return TileSizeOf(frame, partition);
  // If a frame resumes an image, the tiles of that image may have been divided into cells.
  const bool distributes = frame.stop.IsActive() || !frame.resumed.sha256_hex.empty();
  return distributes && partition.cell_size_px != 0 ? partition.cell_size_px
                                                    : partition.tile_size_px;
}

CellGrid::CellGrid(const PixelRect& window, int32_t tile_size_px, int32_t cell_size_px,
                   bool has_light_tile, bool has_training_tile)
    : window_(window),
      tile_size_px_(tile_size_px),
      cell_size_px_(cell_size_px),
      tiles_(CutTiles(window, tile_size_px)),
      has_training_tile_(has_training_tile) {
  SHEAF_CHECK(!tiles_.empty() && DividesIntoCells(tile_size_px, cell_size_px));
  first_cells_.reserve(tiles_.size() + 3);
  if (cell_size_px == tile_size_px) {
    cells_ = tiles_;
    first_cells_.resize(tiles_.size() + 1);
    std::iota(first_cells_.begin(), first_cells_.end(), 0);
  } else {
    for (const PixelRect& tile : tiles_) {
      first_cells_.push_back(static_cast<uint32_t>(cells_.size()));
      const std::vector<PixelRect> cells = CutTiles(tile, cell_size_px);
      cells_.insert(cells_.end(), cells.begin(), cells.end());
    }
    first_cells_.push_back(static_cast<uint32_t>(cells_.size()));
  }
  if (has_light_tile) first_cells_.push_back(first_cells_.back() + 1);
  if (has_training_tile) first_cells_.push_back(first_cells_.back() + 1);
}

std::optional<uint32_t> CellGrid::light_tile() const {
  if (tile_count() == tiles_.size()) return std::nullopt;
  return tile_count() - 1;
}

std::optional<uint32_t> CellGrid::training_tile() const {
  if (!has_training_tile_) return std::nullopt;
  return tile_count();
}

std::span<const PixelRect> CellGrid::CellRectsOf(uint32_t tile) const {
  if (KindOf(tile) != TaskKind::kCamera) return {&window_, 1};
  return std::span(cells_).subspan(first_cell(tile), cell_count(tile));
}

std::optional<uint32_t> CellGrid::FindTile(const PixelRect& rect, TaskKind kind) const {
  if (kind != TaskKind::kCamera && !(rect == window_)) return std::nullopt;
  if (kind == TaskKind::kLight) return light_tile();
  if (kind == TaskKind::kTraining) return training_tile();
  const auto before = [](const PixelRect& tile, const PixelRect& wanted) {
    return std::tie(tile.y0, tile.x0) < std::tie(wanted.y0, wanted.x0);
  };
  const auto found = std::lower_bound(tiles_.begin(), tiles_.end(), rect, before);
  if (found == tiles_.end() || !(*found == rect)) return std::nullopt;
  return static_cast<uint32_t>(found - tiles_.begin());
}

uint32_t CellGrid::TileOf(uint32_t cell) const {
  const auto after = std::ranges::upper_bound(first_cells_, cell);
  return static_cast<uint32_t>(after - first_cells_.begin()) - 1;
}

std::optional<uint64_t> CellGrid::MaskOf(uint32_t tile, const TileCells& cells) const {
  if (cells.All()) return AllOf(tile);
  if (KindOf(tile) != TaskKind::kCamera || cells.size_px != cell_size_px_ ||
      !WhyNoCells(tiles_[tile], cells).empty()) {
    return std::nullopt;
  }
  return cells.mask;
}

TileCells CellGrid::CellsOf(uint32_t tile, uint64_t mask) const {
  SHEAF_CHECK(mask != 0 && (mask & ~AllOf(tile)) == 0);
  return mask == AllOf(tile) ? TileCells{} : TileCells{cell_size_px_, mask};
}

std::vector<double> CellGrid::Distribute(std::span<const double> of_tiles,
                                         std::span<const double> weights) const {
  std::vector<double> fractions(weights.begin(), weights.end());
  for (uint32_t tile = 0; tile < tiles_.size(); ++tile) {
    const std::span<double> cells =
        std::span(fractions).subspan(first_cell(tile), cell_count(tile));
    double sum = 0;
    for (const double weight : cells) sum += weight;
    for (double& fraction : cells) fraction *= of_tiles[tile] / sum;
  }
  return fractions;
}

}  // namespace sheaf::coordinator
