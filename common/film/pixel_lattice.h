// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PixelLattice: a sparse choice of a frame's pixels from which properties of all pixels can be
// estimated (cost_forecast.h). Each cell of stride x stride pixels has one block at a random
// position. The pixels of the block's core have all samples; the rim around it has only the first
// few, so that each pixel of the core has neighbors for its error estimate (error_estimate.h).
// Cells are aligned to the frame, so the choice of a pixel does not depend on the crop and the
// tiles; the positions change with the frame's seed, as its samples do. Source: cluster sampling
// within strata, Cochran 1977, Sampling Techniques, chapters 5 and 9.
#pragma once

#include <cstdint>

#include "common/film/tile_geometry.h"

namespace sheaf {

inline constexpr int32_t kLatticeCorePx = 3, kLatticeRimPx = 1;
inline constexpr int32_t kLatticeBlockPx = kLatticeCorePx + 2 * kLatticeRimPx;
// Maximum number of samples of a pixel of the rim: those of the smallest indices.
inline constexpr uint64_t kLatticeRimSamples = 4;
inline constexpr int32_t kPixelStrideMin = kLatticeBlockPx + 1, kPixelStrideMax = 512;

struct PixelLattice {
  int32_t stride_px = 1;  // 1: all pixels. Otherwise from kPixelStrideMin to kPixelStrideMax.
  uint64_t seed = 0;      // The frame's; 0 if all pixels are chosen.

  bool operator==(const PixelLattice&) const = default;
  bool All() const { return stride_px == 1; }
  // The chosen block of the cell, including its rim. Requires: not All().
  PixelRect BlockOf(int32_t cell_x, int32_t cell_y) const;
  // Whether a pixel has all samples, those of the rim, or none. Requires: x, y >= 0.
  enum class Part { kOutside, kRim, kCore };
  Part PartOf(int32_t x, int32_t y) const;
  // The samples of the block that the pixel has; a count of 0 if it has none.
  SampleBlock SamplesOf(Part part, SampleBlock block) const;
  // The number of pixels of the rectangle that have all samples.
  int64_t CountIn(const PixelRect& rect) const;
  // The number of samples of the rectangle's pixels, including rims, if `samples` is the full
  // number.
  uint64_t SampleCountIn(const PixelRect& rect, uint64_t samples) const;
  // Average number of samples per pixel of a large frame, over all pixels, chosen or not.
  double SamplesPerPixel(uint64_t samples) const;

 private:
  int64_t CountIn(const PixelRect& rect, int32_t rim_px) const;
};

}  // namespace sheaf
