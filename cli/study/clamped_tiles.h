// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ClampedTiles: the image that results if each sample is clamped to some brightness, as other
// renderers do against fireflies. It is computed from the parts of an unclamped rendering.
#pragma once

#include <array>
#include <vector>

#include "cli/study/study_tiles.h"

namespace sheaf::cli {

class ClampedTiles {
 public:
  // limit: for the largest of R, G and B of a sample.
  ClampedTiles(const std::vector<PixelRect>& tiles, double limit);
  // Requires: the part is a block of one sample of each replicate. Thread safety: calls for
  // distinct tiles may run concurrently.
  void Add(size_t tile, const FilmTile& part);
  TilePixels Develop(size_t tile) const;

 private:
  double limit_;
  // Sums of a pixel by replicate: R, G, B, weight.
  using Sums = std::array<std::array<double, 4>, kReplicateCount>;
  std::vector<std::vector<Sums>> sums_;  // By tile.
};

}  // namespace sheaf::cli
