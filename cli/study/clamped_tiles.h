// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ClampedTiles: the picture that there would be had each sample been cut at some brightness, as
// other renderers do against bright pixels. From the parts of one that was rendered without.
#pragma once

#include <array>
#include <vector>

#include "cli/study/study_tiles.h"

namespace sheaf::cli {

class ClampedTiles {
 public:
  // limit: of the largest of R, G and B of a sample.
  ClampedTiles(const std::vector<PixelRect>& tiles, double limit);
  // Requires: the part is a block of one sample of each replicate. Distinct tiles may be added to
  // concurrently.
  void Add(size_t tile, const FilmTile& part);
  TilePixels Develop(size_t tile) const;

 private:
  double limit_;
  // Of a pixel, by replicate: R, G, B, weight.
  using Sums = std::array<std::array<double, 4>, kReplicateCount>;
  std::vector<std::vector<Sums>> sums_;  // Of each tile.
};

}  // namespace sheaf::cli
