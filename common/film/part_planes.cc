// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/part_planes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "absl/strings/str_cat.h"

namespace sheaf {

std::string WhyNoSums(FilmTile& tile, const PixelLattice& lattice, const TileCells& cells) {
  for (const auto& plane : PlanesOf<float>(tile)) {
    for (size_t p = 0; p < tile.plane_size(); ++p) {
      if (std::isfinite(plane.pixels[p])) continue;
      return absl::StrCat("channel \"", plane.name, "\" holds a value that is not finite");
    }
  }
  constexpr uint64_t kExactCountMax = 1 << 24;  // Floats above this skip integers.
  const float* samples = tile.channel(FilmChannel::kSampleCount);
  const float* nonfinite = tile.channel(FilmChannel::kNonFiniteCount);
  const PixelRect& rect = tile.rect();
  std::vector<char> chosen(tile.plane_size());
  for (const PixelRect& cell : RectsOf(rect, cells)) {
    for (int32_t y = cell.y0; y < cell.y1; ++y) {
      std::fill_n(chosen.begin() + static_cast<ptrdiff_t>(rect.IndexOf(cell.x0, y)), cell.Width(),
                  char{1});
    }
  }
  size_t p = 0;
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x, ++p) {
      const uint64_t count =
          chosen[p] == 0 ? 0 : lattice.SamplesOf(lattice.PartOf(x, y), tile.block()).count;
      const bool adds_up =
          count > kExactCountMax || samples[p] + nonfinite[p] == static_cast<float>(count);
      if (samples[p] < 0 || nonfinite[p] < 0 || !adds_up) return "wrong sample counts";
    }
  }
  return "";
}

}  // namespace sheaf
