// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The division of a frame: pixel rectangles (tiles) and aligned power-of-two blocks of sample
// indices.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace sheaf {

// Half-open rectangle of pixels [x0, x1) x [y0, y1), in the full frame's raster coordinates
// (x to the right, y down, origin at the top left of the uncropped frame).
struct PixelRect {
  int32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  constexpr int32_t Width() const { return x1 - x0; }
  constexpr int32_t Height() const { return y1 - y0; }
  constexpr int64_t PixelCount() const { return int64_t{Width()} * Height(); }
  // Index of a pixel inside, in row-major planes over the rectangle's pixels.
  constexpr size_t IndexOf(int32_t x, int32_t y) const {
    return static_cast<size_t>(y - y0) * static_cast<size_t>(Width()) + static_cast<size_t>(x - x0);
  }
  constexpr bool IsEmpty() const { return x0 >= x1 || y0 >= y1; }
  constexpr bool Contains(const PixelRect& inner) const {
    return x0 <= inner.x0 && y0 <= inner.y0 && inner.x1 <= x1 && inner.y1 <= y1;
  }
  friend constexpr bool operator==(const PixelRect&, const PixelRect&) = default;
};
// The intersection; may be empty.
constexpr PixelRect Intersect(const PixelRect& a, const PixelRect& b) {
  return {std::max(a.x0, b.x0), std::max(a.y0, b.y0), std::min(a.x1, b.x1), std::min(a.y1, b.y1)};
}

// Aligned block of sample indices [first, first + count): count is a power of two and divides
// first. It is one node of the canonical tree of merging.
struct SampleBlock {
  uint64_t first = 0;
  uint64_t count = 1;
  constexpr uint64_t End() const { return first + count; }
  friend constexpr bool operator==(const SampleBlock&, const SampleBlock&) = default;
};
// All sample indices are below this, so that sums and parents of blocks never wrap around.
inline constexpr uint64_t kSampleIndexEnd = uint64_t{1} << 62;
constexpr bool IsAligned(SampleBlock b) {
  return b.count != 0 && (b.count & (b.count - 1)) == 0 && b.first % b.count == 0 &&
         b.first < kSampleIndexEnd && b.count <= kSampleIndexEnd;
}
constexpr SampleBlock Sibling(SampleBlock b) { return {b.first ^ b.count, b.count}; }
constexpr SampleBlock Parent(SampleBlock b) { return {b.first & ~(b.count * 2 - 1), b.count * 2}; }
constexpr bool Contains(SampleBlock outer, SampleBlock inner) {
  return outer.first <= inner.first && inner.End() <= outer.End();
}

// Cuts [first, first + count) into the fewest aligned blocks of at most block_samples_max samples,
// in ascending order. Any two aligned blocks are nested or disjoint.
// Requires: block_samples_max is a power of two; first + count <= kSampleIndexEnd.
std::vector<SampleBlock> CutSamples(uint64_t first, uint64_t count, uint64_t block_samples_max);

// Cuts a rectangle into tiles of tile_size_px (the last of a row or column may be smaller), aligned
// to multiples of tile_size_px in the frame, row by row; so a pixel's tile does not depend on the
// crop.
// Requires: tile_size_px > 0. An empty rectangle gives no tiles.
std::vector<PixelRect> CutTiles(PixelRect frame, int32_t tile_size_px);

}  // namespace sheaf
