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
  std::vector<Sums>& sums = sums_[tile];
  for (uint32_t slot = 0; slot < part.replicate_count(); ++slot) {
    for (size_t p = 0; p < sums.size(); ++p) {
      const auto value = [&](size_t c) { return static_cast<double>(part.replicate(slot, c)[p]); };
      const double weight = value(3);
      double largest = 0;
      for (size_t c = 0; c < 3; ++c) largest = std::max(largest, std::fabs(value(c)));
      const double most = limit_ * std::fabs(weight);
      const double scale = largest > most ? most / largest : 1;
      std::array<double, 4>& sum = sums[p][part.replicate_first() + slot];
      for (size_t c = 0; c < 3; ++c) sum[c] += scale * value(c);
      sum[3] += weight;
    }
  }
}

TilePixels ClampedTiles::Develop(size_t tile) const {
  const std::vector<Sums>& sums = sums_[tile];
  TilePixels pixels{std::vector<std::array<float, 3>>(sums.size()),
                    std::vector<std::array<float, 3>>(sums.size())};
  for (size_t p = 0; p < sums.size(); ++p) {
    std::array<double, 4> all{};
    for (const std::array<double, 4>& sum : sums[p]) {
      for (size_t c = 0; c < 4; ++c) all[c] += sum[c];
    }
    if (all[3] == 0) continue;
    for (size_t c = 0; c < 3; ++c) {
      // The ratio estimator's (error_estimate.h).
      const double mean = all[c] / all[3];
      double squares = 0;
      for (const std::array<double, 4>& sum : sums[p]) {
        const double rest = sum[c] - mean * sum[3];
        squares += rest * rest;
      }
      const double n = kReplicateCount;
      pixels.value[p][c] = static_cast<float>(mean);
      pixels.deviation[p][c] =
          static_cast<float>(std::sqrt(squares * n / (n - 1)) / std::fabs(all[3]));
    }
  }
  return pixels;
}

}  // namespace sheaf::cli
