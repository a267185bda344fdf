// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PixelLattice: a sparse choice of a frame's pixels, from which what is true of all of them can be
// estimated (cost_forecast.h): of each cell of stride x stride pixels one block, at a place drawn
// at random. The pixels of the block's core have all samples; a rim about it has the first few
// alone, so that each pixel of the core has neighbours to tell how wrong it is (error_estimate.h).
// Cells are aligned to the frame, so a pixel is chosen or not whatever the crop and the tiles; the
// places change with the frame's seed, as its samples do.
// Source: cluster sampling within strata, Cochran 1977, Sampling Techniques, chapters 5 and 9.
#pragma once

#include <cstdint>

#include "common/film/tile_geometry.h"

namespace sheaf {

inline constexpr int32_t kLatticeCorePx = 3, kLatticeRimPx = 1;
inline constexpr int32_t kLatticeBlockPx = kLatticeCorePx + 2 * kLatticeRimPx;
// Samples that a pixel of the rim has at most: those of the smallest indices.
inline constexpr uint64_t kLatticeRimSamples = 4;
inline constexpr int32_t kPixelStrideMin = kLatticeBlockPx + 1, kPixelStrideMax = 512;

struct PixelLattice {
  int32_t stride_px = 1;  // 1: all pixels. Otherwise from kPixelStrideMin to kPixelStrideMax.
  uint64_t seed = 0;      // The frame's; 0 where all pixels are chosen.

  bool operator==(const PixelLattice&) const = default;
  bool All() const { return stride_px == 1; }
  // The block that is chosen of the cell, its rim included. Requires: not All().
  PixelRect BlockOf(int32_t cell_x, int32_t cell_y) const;
  // Whether a pixel has all samples, or those of the rim. Requires: x, y >= 0.
  enum class Part { kOutside, kRim, kCore };
  Part PartOf(int32_t x, int32_t y) const;
  // The samples of the block that the pixel has; a count of 0 where it has none.
  SampleBlock SamplesOf(Part part, SampleBlock block) const;
  // How many pixels of the rectangle have all samples.
  int64_t CountIn(const PixelRect& rect) const;
  // Samples of the rectangle's pixels, the rims' included, where all have `samples`.
  uint64_t SampleCountIn(const PixelRect& rect, uint64_t samples) const;
  // Samples over all pixels of a large frame, for each of them.
  double SamplesPerPixel(uint64_t samples) const;

 private:
  int64_t CountIn(const PixelRect& rect, int32_t rim_px) const;
};

}  // namespace sheaf
