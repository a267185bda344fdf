// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CellTrees: the parts of one tile, merged per cell: each cell has a TileTree and may have its own
// number of samples. An undivided tile is one cell.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "common/film/tile_tree.h"

namespace sheaf {

class CellTrees {
 public:
  // cells: cover the tile's pixels without overlap; at most kTileCellsMax.
  CellTrees(PixelRect tile, std::span<const PixelRect> cells);

  // mask: bit i selects cells[i]. The part covers the whole tile, or the single selected cell.
  // Errors: those of TileTree::Insert; after an error some cells may already contain the part.
  // Requires: mask is not 0.
  absl::Status Insert(FilmTile part, uint64_t mask);
  uint64_t SampleCount(size_t cell) const { return trees_[cell].SampleCount(); }
  uint64_t size_bytes() const;
  // The whole tile, with each pixel from its cell's tree: TileTree::Root and PreviewSum. The block
  // is the smallest one starting at 0 that contains all samples.
  // Requires: for Root, samples in every cell, each as TileTree::Root requires; for PreviewSum,
  // samples in at least one cell.
  FilmTile Root() const&;
  // The same, with no copy where the tile is one cell of one node; empty afterwards.
  FilmTile Root() &&;
  FilmTile PreviewSum() const;

 private:
  template <typename SumOf>
  FilmTile Compose(const SumOf& sum_of) const;

  PixelRect tile_;
  std::vector<TileTree> trees_;
};

}  // namespace sheaf
