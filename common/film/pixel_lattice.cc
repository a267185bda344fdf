// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/pixel_lattice.h"

#include <algorithm>

namespace sheaf {
namespace {

// Source: Steele et al. 2014, SplitMix64.
uint64_t Mix(uint64_t v) {
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}

}  // namespace

PixelRect PixelLattice::BlockOf(int32_t cell_x, int32_t cell_y) const {
  const uint64_t cell =
      (uint64_t{static_cast<uint32_t>(cell_y)} << 32) | static_cast<uint32_t>(cell_x);
  const uint64_t bits = Mix(Mix(cell + 0x9e3779b97f4a7c15u) ^ static_cast<uint32_t>(stride_px));
  const auto places = static_cast<uint32_t>(stride_px - kPixelBlockPx + 1);
  const int32_t x = cell_x * stride_px + static_cast<int32_t>((bits >> 40) % places);
  const int32_t y = cell_y * stride_px + static_cast<int32_t>(((bits >> 16) & 0xffffff) % places);
  return {x, y, x + kPixelBlockPx, y + kPixelBlockPx};
}

bool PixelLattice::Has(int32_t x, int32_t y) const {
  if (All()) return true;
  const PixelRect block = BlockOf(x / stride_px, y / stride_px);
  return x >= block.x0 && x < block.x1 && y >= block.y0 && y < block.y1;
}

int64_t PixelLattice::CountIn(const PixelRect& rect) const {
  if (All()) return rect.PixelCount();
  int64_t count = 0;
  for (int32_t cell_y = rect.y0 / stride_px; cell_y * stride_px < rect.y1; ++cell_y) {
    for (int32_t cell_x = rect.x0 / stride_px; cell_x * stride_px < rect.x1; ++cell_x) {
      const PixelRect block = BlockOf(cell_x, cell_y);
      const int64_t width = std::min(block.x1, rect.x1) - std::max(block.x0, rect.x0);
      const int64_t height = std::min(block.y1, rect.y1) - std::max(block.y0, rect.y0);
      if (width > 0 && height > 0) count += width * height;
    }
  }
  return count;
}

}  // namespace sheaf
