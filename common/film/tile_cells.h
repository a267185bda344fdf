// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TileCells: some of a tile's pixels. A tile may be divided into squares, its cells, aligned to the
// frame as tiles are. A part has a block's samples for all pixels of its tile or for those of some
// cells, so that cells get the samples that each of them needs and parts are no more for that
// (docs/adr/0042).
#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <vector>

#include "common/film/film_tile.h"

namespace sheaf {

// Of a tile, as many as a mask has bits.
inline constexpr int32_t kTileCellsMax = 64;

struct TileCells {
  int32_t size_px = 0;  // Edge of a cell; 0: all pixels of the tile.
  uint64_t mask = 0;    // Which of the cells, from bit 0 on, row by row; never all of them.

  bool All() const { return size_px == 0; }
  friend auto operator<=>(const TileCells&, const TileCells&) = default;
};

// Why the tile has no such cells; empty where it has. Of cells that came from elsewhere.
std::string WhyNoCells(const PixelRect& tile, const TileCells& cells);

// The chosen cells, row by row; the tile itself where that is all. Requires: WhyNoCells is empty.
std::vector<PixelRect> RectsOf(const PixelRect& tile, const TileCells& cells);

// The sums of some of a tile's pixels. Requires: they are within.
FilmTile CutOut(const FilmTile& tile, const PixelRect& rect);
// Puts the sums of some of a tile's pixels into it. Requires: they are within, its block contains
// the pixels'.
void Paste(const FilmTile& pixels, FilmTile* tile);

}  // namespace sheaf
