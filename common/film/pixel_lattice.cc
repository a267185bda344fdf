// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/pixel_lattice.h"

#include <algorithm>

#include "common/math/mix_bits.h"

namespace sheaf {

PixelRect PixelLattice::BlockOf(int32_t cell_x, int32_t cell_y) const {
  const uint64_t cell =
      (uint64_t{static_cast<uint32_t>(cell_y)} << 32) | static_cast<uint32_t>(cell_x);
  const uint64_t bits = MixBits(MixBits(MixBits(cell + 0x9e3779b97f4a7c15u) + seed) ^
                                static_cast<uint32_t>(stride_px));
  const auto places = static_cast<uint32_t>(stride_px - kLatticeBlockPx + 1);
  const int32_t x = cell_x * stride_px + static_cast<int32_t>((bits >> 40) % places);
  const int32_t y = cell_y * stride_px + static_cast<int32_t>(((bits >> 16) & 0xffffff) % places);
  return {x, y, x + kLatticeBlockPx, y + kLatticeBlockPx};
}

PixelLattice::Part PixelLattice::PartOf(int32_t x, int32_t y) const {
  if (All()) return Part::kCore;
  const PixelRect block = BlockOf(x / stride_px, y / stride_px);
  const int32_t inside = std::min({x - block.x0, block.x1 - 1 - x, y - block.y0, block.y1 - 1 - y});
  if (inside < 0) return Part::kOutside;
  return inside < kLatticeRimPx ? Part::kRim : Part::kCore;
}

SampleBlock PixelLattice::SamplesOf(Part part, SampleBlock block) const {
  if (part == Part::kCore) return block;
  if (part == Part::kOutside || block.first >= kLatticeRimSamples) return {block.first, 0};
  return {block.first, std::min(block.count, kLatticeRimSamples - block.first)};
}

int64_t PixelLattice::CountIn(const PixelRect& rect, int32_t rim_px) const {
  int64_t count = 0;
  for (int32_t cell_y = rect.y0 / stride_px; cell_y * stride_px < rect.y1; ++cell_y) {
    for (int32_t cell_x = rect.x0 / stride_px; cell_x * stride_px < rect.x1; ++cell_x) {
      const PixelRect block = BlockOf(cell_x, cell_y);
      const int64_t width =
          std::min(block.x1 - rim_px, rect.x1) - std::max(block.x0 + rim_px, rect.x0);
      const int64_t height =
          std::min(block.y1 - rim_px, rect.y1) - std::max(block.y0 + rim_px, rect.y0);
      if (width > 0 && height > 0) count += width * height;
    }
  }
  return count;
}

int64_t PixelLattice::CountIn(const PixelRect& rect) const {
  return All() ? rect.PixelCount() : CountIn(rect, kLatticeRimPx);
}

uint64_t PixelLattice::SampleCountIn(const PixelRect& rect, uint64_t samples) const {
  const auto core = static_cast<uint64_t>(CountIn(rect));
  if (All()) return core * samples;
  const auto all = static_cast<uint64_t>(CountIn(rect, 0));
  return core * samples + (all - core) * std::min(samples, kLatticeRimSamples);
}

double PixelLattice::SamplesPerPixel(uint64_t samples) const {
  if (All()) return static_cast<double>(samples);
  constexpr double kCore = kLatticeCorePx * kLatticeCorePx;
  constexpr double kRim = kLatticeBlockPx * kLatticeBlockPx - kCore;
  const double of_block = kCore * static_cast<double>(samples) +
                          kRim * static_cast<double>(std::min(samples, kLatticeRimSamples));
  return of_block / (1.0 * stride_px * stride_px);
}

}  // namespace sheaf
