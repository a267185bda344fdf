// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/cell_trees.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "common/base/check.h"
#include "common/film/tile_cells.h"

namespace sheaf {

CellTrees::CellTrees(PixelRect tile, std::span<const PixelRect> cells) : tile_(tile) {
  SHEAF_CHECK(!cells.empty() && cells.size() <= kTileCellsMax);
  trees_.reserve(cells.size());
  for (const PixelRect& cell : cells) trees_.emplace_back(cell);
}

absl::Status CellTrees::Insert(FilmTile part, uint64_t mask) {
  SHEAF_CHECK(mask != 0 && static_cast<size_t>(std::bit_width(mask)) <= trees_.size());
  const auto first = static_cast<size_t>(std::countr_zero(mask));
  if (part.rect() == trees_[first].rect()) {
    SHEAF_CHECK(std::has_single_bit(mask));
    return trees_[first].Insert(std::move(part));
  }
  if (!(part.rect() == tile_)) {
    return absl::InvalidArgumentError(
        "the part covers other pixels than the tile it was inserted in");
  }
  for (; mask != 0; mask &= mask - 1) {
    TileTree& tree = trees_[static_cast<size_t>(std::countr_zero(mask))];
    absl::Status status = tree.Insert(CutOut(part, tree.rect()));
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

uint64_t CellTrees::size_bytes() const {
  uint64_t size_bytes = 0;
  for (const TileTree& tree : trees_) {
    for (const auto& [first, node] : tree.nodes()) size_bytes += node.size_bytes();
  }
  return size_bytes;
}

template <typename SumOf>
FilmTile CellTrees::Compose(const SumOf& sum_of) const {
  if (trees_.size() == 1) return sum_of(trees_.front());
  std::vector<FilmTile> sums;
  uint64_t end = 1;
  for (const TileTree& tree : trees_) {
    if (tree.nodes().empty()) continue;
    sums.push_back(sum_of(tree));
    end = std::max(end, sums.back().block().End());
  }
  SHEAF_CHECK(!sums.empty());
  FilmTile whole(tile_, {0, std::bit_ceil(end)}, sums.front().outputs());
  for (const FilmTile& sum : sums) Paste(sum, &whole);
  return whole;
}

FilmTile CellTrees::Root() const& {
  const bool complete =
      std::ranges::none_of(trees_, [](const TileTree& tree) { return tree.nodes().empty(); });
  SHEAF_CHECK(complete);
  return Compose([](const TileTree& tree) { return tree.Root(); });
}

FilmTile CellTrees::Root() && {
  if (trees_.size() == 1) return std::move(trees_.front()).Root();
  return std::as_const(*this).Root();
}

FilmTile CellTrees::PreviewSum() const {
  return Compose([](const TileTree& tree) { return tree.PreviewSum(); });
}

}  // namespace sheaf
