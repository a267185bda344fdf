// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/clamped_tiles.h"

#include <algorithm>
#include <cmath>

namespace sheaf::cli {

ClampedTiles::ClampedTiles(const std::vector<PixelRect>& tiles, double limit) : limit_(limit) {
  for (const PixelRect& tile : tiles) sums_.emplace_back(tile.PixelCount());
}

void ClampedTiles::Add(size_t tile, const FilmTile& part) {
  std::vector<std::array<double, 4>>& sums = sums_[tile];
  for (uint32_t slot = 0; slot < part.replicate_count(); ++slot) {
    for (size_t p = 0; p < sums.size(); ++p) {
      const auto value = [&](size_t c) { return static_cast<double>(part.replicate(slot, c)[p]); };
      const double weight = value(3);
      double largest = 0;
      for (size_t c = 0; c < 3; ++c) largest = std::max(largest, std::fabs(value(c)));
      const double most = limit_ * std::fabs(weight);
      const double scale = largest > most ? most / largest : 1;
      for (size_t c = 0; c < 3; ++c) sums[p][c] += scale * value(c);
      sums[p][3] += weight;
    }
  }
}

TilePixels ClampedTiles::Develop(size_t tile) const {
  const std::vector<std::array<double, 4>>& sums = sums_[tile];
  TilePixels pixels{std::vector<std::array<float, 3>>(sums.size()),
                    std::vector<std::array<float, 3>>(sums.size())};
  for (size_t p = 0; p < sums.size(); ++p) {
    for (size_t c = 0; c < 3; ++c) {
      pixels.value[p][c] = sums[p][3] == 0 ? 0 : static_cast<float>(sums[p][c] / sums[p][3]);
    }
  }
  return pixels;
}

}  // namespace sheaf::cli
