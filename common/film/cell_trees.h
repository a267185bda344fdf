// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CellTrees: the parts of one tile, merged cell by cell: each of its cells has a TileTree and may
// have samples of its own. A tile that is not divided is one cell.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "common/film/tile_tree.h"

namespace sheaf {

class CellTrees {
 public:
  // cells: all of the tile's pixels, without overlap; at most kTileCellsMax.
  CellTrees(PixelRect tile, std::span<const PixelRect> cells);

  // mask: bit i for cells[i]. The part is of the tile, or of the one cell that is chosen.
  // Errors: those of TileTree::Insert; some cells may have the part then. Requires: mask has bits.
  absl::Status Insert(FilmTile part, uint64_t mask);
  uint64_t SampleCount(size_t cell) const { return trees_[cell].SampleCount(); }
  uint64_t size_bytes() const;
  // All of the tile, each pixel as its cell's tree has it: TileTree::Root and PreviewSum. The block
  // is the smallest from 0 on that has all samples. Requires: of Root, samples in every cell, each
  // as TileTree::Root wants them; of PreviewSum, samples in one.
  FilmTile Root() const;
  FilmTile PreviewSum() const;

 private:
  template <typename SumOf>
  FilmTile Compose(const SumOf& sum_of) const;

  PixelRect tile_;
  std::vector<TileTree> trees_;
};

}  // namespace sheaf
