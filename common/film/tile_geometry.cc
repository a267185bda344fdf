// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/tile_geometry.h"

#include <algorithm>
#include <bit>

#include "common/base/check.h"

namespace sheaf {
namespace {

// The smallest multiple of step above v.
int64_t NextMultiple(int64_t v, int64_t step) {
  const int64_t remainder = ((v % step) + step) % step;
  return v - remainder + step;
}

}  // namespace

std::vector<SampleBlock> CutSamples(uint64_t first, uint64_t count, uint64_t block_samples_max) {
  SHEAF_CHECK(std::has_single_bit(block_samples_max));
  SHEAF_CHECK(first <= kSampleIndexEnd && count <= kSampleIndexEnd - first);
  std::vector<SampleBlock> blocks;
  while (count > 0) {
    uint64_t size = std::min(std::bit_floor(count), block_samples_max);
    // The lowest set bit of first is the largest power of two that divides it.
    if (first != 0) size = std::min(size, first & (~first + 1));
    blocks.push_back({first, size});
    first += size;
    count -= size;
  }
  return blocks;
}

std::vector<PixelRect> CutTiles(PixelRect frame, int32_t tile_size_px) {
  SHEAF_CHECK(tile_size_px > 0);
  std::vector<PixelRect> tiles;
  for (int64_t y0 = frame.y0; y0 < frame.y1;) {
    const int64_t y1 = std::min<int64_t>(NextMultiple(y0, tile_size_px), frame.y1);
    for (int64_t x0 = frame.x0; x0 < frame.x1;) {
      const int64_t x1 = std::min<int64_t>(NextMultiple(x0, tile_size_px), frame.x1);
      tiles.push_back({static_cast<int32_t>(x0), static_cast<int32_t>(y0), static_cast<int32_t>(x1),
                       static_cast<int32_t>(y1)});
      x0 = x1;
    }
    y0 = y1;
  }
  return tiles;
}

}  // namespace sheaf
