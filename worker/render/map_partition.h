// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MapPartition: from where in a square map to sample. The map is cut into squares, few where it is
// even and small where it is not, down to a quarter of a texel; a square is chosen by the root mean
// square of its luminance and a point in it uniformly. So the pdf is constant in a square, positive
// wherever the map is, and known from a table that stays in the caches, without a look at the map.
//
// Which squares: those of a quadtree that minimise the second moment of light sampling plus a price
// for each square. For a map l sampled with a pdf p that is constant in each square that moment,
// the integral of l^2 / p, is least for p ~ rms(l), and then the squared sum of area * rms(l); so
// area * rms(l) + price, minimised from the leaves up, gives the tree that is best for its size
// (Breiman et al. 1984, ch. 3, pruning by cost and complexity). Squares stand in the order of
// Hilbert's curve: near on it is near on the map, which keeps the stratification of the points that
// sampling is given. See docs/adr/0007.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::render {

class MapPartition {
 public:
  // p: in texels, in [0, size]^2. pdf: by area of the map, which counts as 1; positive.
  struct Choice {
    Vec2f p;
    float pdf = 0;
  };

  MapPartition() = default;
  // luminance: row-major [size][size] at texel centres, finite, not negative; between them the map
  // is bilinear, with octahedral wrap.
  MapPartition(int size, const std::vector<float>& luminance);

  // Where the map is black.
  bool empty() const { return squares_.empty(); }
  // Mean over the map.
  double mean() const { return mean_; }
  // u: in [0, 1)^2. Requires: !empty().
  Choice Choose(Vec2f u) const;
  // The pdf of Choose at p, as in Choice. Requires: !empty().
  float Pdf(Vec2f p) const {
    const uint32_t x = Index(p.x), y = Index(p.y);
    uint32_t entry = grid_[y / kCellSide * cells_across_ + x / kCellSide];
    if (IsLink(entry)) entry = EntryIn(entry, x / kUnits, y / kUnits);
    if (IsLink(entry)) entry = EntryIn(entry, x, y);
    return std::bit_cast<float>(entry);
  }
  size_t square_count() const { return empty() ? 0 : squares_.size() - 1; }
  // The second moment of light sampling over that of sampling the map itself; at least 1.
  double second_moment_ratio() const { return second_moment_ratio_; }
  size_t size_bytes() const;

 private:
  friend class MapPartitionBuilder;
  // Lengths are counted in units of a quarter texel.
  static constexpr uint32_t kUnits = 4;
  static constexpr uint32_t kCellSide = 4 * kUnits;  // Of the table's grid.
  // Of the cumulative probabilities, integers: what a square has got is exactly what its pdf says.
  static constexpr uint32_t kProbabilityOne = uint32_t{1} << 31;

  struct Square {
    uint32_t begin = 0;     // Cumulative probability before it; the next one's is its end.
    uint16_t x = 0, y = 0;  // In units.
    float side = 0;         // In texels.
    float pdf = 0;
  };

  uint32_t Index(float v) const {
    const auto units = static_cast<float>(kUnits);
    // Also for NaN.
    return v > 0 ? std::min(static_cast<uint32_t>(v * units), index_max_) : 0;
  }
  // An entry is the bits of a pdf or, with the sign bit set, the number of a block of 4 x 4 entries
  // for the parts of what it stands for.
  static bool IsLink(uint32_t entry) { return entry >> 31 != 0; }
  uint32_t EntryIn(uint32_t link, uint32_t x, uint32_t y) const {
    return blocks_[(link & 0x7fffffff) * 16 + y % 4 * 4 + x % 4];
  }
  void SetCumulative(const std::vector<double>& weights);
  void SetPdf(uint32_t x, uint32_t y, uint32_t side, float pdf);
  // The block of an entry, made where there is none yet. Returns the index of its first entry.
  size_t BlockOf(uint32_t* entry);

  uint32_t index_max_ = 0;
  uint32_t cells_across_ = 0;
  int guide_shift_ = 0;
  double mean_ = 0, second_moment_ratio_ = 1;
  std::vector<Square> squares_;  // And one more, to end the last.
  std::vector<uint32_t> guide_;  // By the first bits of a cumulative probability: its square.
  std::vector<uint32_t> grid_;   // Entries, [cells_across_][cells_across_].
  std::vector<uint32_t> blocks_;
};

}  // namespace sheaf::render
