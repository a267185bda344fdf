// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The error of a rendered tile, estimated from its replicates.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/film/film_tile.h"

namespace sheaf::render {

// Variance of the pixels' means of the red channel, averaged over pixels: their mean squared error.
// Requires: more than one replicate, each with samples in every pixel.
inline double VarianceOfMeans(const FilmTile& tile) {
  double variance = 0;
  for (size_t pixel = 0; pixel < tile.plane_size(); ++pixel) {
    double sum = 0, squares = 0;
    for (uint32_t r = 0; r < tile.replicate_count(); ++r) {
      const double mean = static_cast<double>(tile.replicate(r, 0)[pixel]) /
                          static_cast<double>(tile.replicate(r, 3)[pixel]);
      sum += mean;
      squares += mean * mean;
    }
    const double count = tile.replicate_count();
    variance += (squares - sum * sum / count) / (count * (count - 1));
  }
  return variance / static_cast<double>(tile.plane_size());
}

}  // namespace sheaf::render
