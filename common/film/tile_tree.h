// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TileTree: the parts of one tile, merged along the canonical tree in any order of arrival.
#pragma once

#include <cstdint>
#include <map>

#include "absl/status/status.h"
#include "common/film/film_tile.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// The parts of one tile. Siblings are merged as soon as both are present, so memory does not grow
// with the number of parts. A pure function of the set: any order of Insert gives the same bits.
class TileTree {
 public:
  explicit TileTree(PixelRect rect) : rect_(rect) {}
  // Errors: kAlreadyExists if the block, or a block that contains it, is already present;
  // kInvalidArgument if the rect differs or the block only partly overlaps a present one.
  absl::Status Insert(FilmTile part);
  bool Covers(SampleBlock block) const;
  uint64_t SampleCount() const;
  // Nodes in ascending order; no two are siblings.
  const std::map<uint64_t, FilmTile>& nodes() const { return nodes_; }
  // The value of the canonical tree over all samples present; absent right halves are skipped.
  // Requires: at least one node; the nodes cover a prefix [0, n). Use Covers to check.
  FilmTile Root() const&;
  // The same, without a copy of the only node; the tree is empty afterwards.
  FilmTile Root() &&;
  // Sum of all nodes in ascending order, gaps allowed: for previews, never for delivery.
  // Requires: at least one node.
  FilmTile PreviewSum() const;
  const PixelRect& rect() const { return rect_; }

 private:
  // Root, with the last node's sums.
  FilmTile SumWithLast(FilmTile sum) const;

  PixelRect rect_;
  std::map<uint64_t, FilmTile> nodes_;  // Keyed by block.first.
};

}  // namespace sheaf
