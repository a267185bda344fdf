// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PixelLattice: a sparse choice of a frame's pixels, from which what is true of all of them can be
// estimated (cost_forecast.h): of each cell of stride x stride pixels one block of 3 x 3, at a
// place drawn at random. A block has neighbours enough to tell how wrong its pixels are
// (error_estimate.h). Cells are aligned to the frame, so a pixel is chosen or not whatever the crop
// and the tiles.
// Source: cluster sampling within strata, Cochran 1977, Sampling Techniques, chapters 5 and 9.
#pragma once

#include <cstdint>

#include "common/film/tile_geometry.h"

namespace sheaf {

inline constexpr int32_t kPixelBlockPx = 3;
inline constexpr int32_t kPixelStrideMin = kPixelBlockPx + 1, kPixelStrideMax = 256;

struct PixelLattice {
  int32_t stride_px = 1;  // 1: all pixels. Otherwise from kPixelStrideMin to kPixelStrideMax.

  bool All() const { return stride_px == 1; }
  // Of all pixels, those that are chosen.
  double Share() const {
    return All() ? 1 : 1.0 * kPixelBlockPx * kPixelBlockPx / (1.0 * stride_px * stride_px);
  }
  // The block that is chosen of the cell. Requires: not All().
  PixelRect BlockOf(int32_t cell_x, int32_t cell_y) const;
  // Requires: x, y >= 0.
  bool Has(int32_t x, int32_t y) const;
  // How many pixels of the rectangle are chosen.
  int64_t CountIn(const PixelRect& rect) const;
};

}  // namespace sheaf
