// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TileCells: a subset of a tile's pixels. A tile may be divided into squares, its cells, aligned to
// the frame as tiles are. A part has a block's samples for all pixels of its tile or for those of
// some cells, so that each cell gets the samples it needs without more parts (docs/adr/0042).
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <vector>

#include "common/film/film_tile.h"

namespace sheaf {

// Per tile, as many as a mask has bits.
inline constexpr int32_t kTileCellsMax = 64;

struct TileCells {
  int32_t size_px = 0;  // Edge of a cell; 0: all pixels of the tile.
  uint64_t mask = 0;    // The selected cells, from bit 0 on, row by row; never all of them.

  bool All() const { return size_px == 0; }
  friend auto operator<=>(const TileCells&, const TileCells&) = default;
};

// Why the tile has no such cells; empty if it has. Validates untrusted cells.
std::string WhyNoCells(const PixelRect& tile, const TileCells& cells);

// The selected cells, row by row; the tile itself if all are selected.
// Requires: WhyNoCells is empty.
std::vector<PixelRect> RectsOf(const PixelRect& tile, const TileCells& cells);

// The sums of the tile's pixels in the rectangle. Requires: it is within the tile.
FilmTile CutOut(const FilmTile& tile, const PixelRect& rect);
// Stores the sums of some of a tile's pixels in it.
// Requires: they are within the tile, and its block contains theirs.
void Paste(const FilmTile& pixels, FilmTile* tile);

}  // namespace sheaf
