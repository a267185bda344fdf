// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MapPartition: samples places in a square map by a function that is given at its texels. The map
// is cut into squares, large where the function is smooth and small elsewhere, down to a quarter of
// a texel; a square is chosen by the function's root mean square and a point in it uniformly. The
// pdf is thus constant in a square, positive wherever the function is, and found in a table that
// stays in the caches, without reading the map.
//
// The squares are the leaves of a quadtree that minimizes the second moment of sampling plus a
// price per square. If f is sampled with a pdf p that is constant in each square, that moment, the
// integral of f^2 / p, is least for p ~ rms(f), and then equals the squared sum of area * rms(f);
// so minimizing area * rms(f) + price from the leaves up gives the best tree for its size (Breiman
// et al. 1984, ch. 3, cost-complexity pruning). Squares are stored in the order of Hilbert's curve:
// neighbors on the curve are neighbors on the map, which keeps the stratification of the sample
// points. See docs/adr/0011.
// is given. See docs/adr/0011.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::render {

class MapPartition {
 public:
  // p: in texels, in [0, size]^2. pdf: per area of the map, whose total is 1; positive.
  struct Choice {
    Vec2f p;
    float pdf = 0;
  };

  MapPartition() = default;
  // values: of the function, row-major [size][size] at texel centers, finite, nonnegative; bilinear
  // in between, with octahedral wrap. Requires: 1 <= size <= 8192.
  MapPartition(int size, const std::vector<float>& values);

  // True where the function is nowhere positive.
  bool empty() const { return squares_.empty(); }
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
  // Second moment of sampling over that with the function itself as pdf; at least 1.
  double second_moment_ratio() const { return second_moment_ratio_; }
  size_t size_bytes() const;

 private:
  friend class MapPartitionBuilder;
  // Lengths are in units of a quarter texel.
  static constexpr uint32_t kUnits = 4;
  static constexpr uint32_t kCellSide = 4 * kUnits;  // Side of the table's cells.
  // Cumulative probabilities are integers, so a square's interval matches its pdf exactly.
  static constexpr uint32_t kProbabilityOne = uint32_t{1} << 31;

  // Kept small, because accesses are random.
  struct Square {
    uint32_t begin = 0;  // Cumulative probability before it; the next one's begin is its end.
    // Position in the quadtree: a one bit, then the bits of x, then those of y, both counted in
    // squares of its size and with as many bits as its depth.
    uint32_t path = 1;
  };

  uint32_t Index(float v) const {
    const auto units = static_cast<float>(kUnits);
    // NaN gives 0.
    return v > 0 ? std::min(static_cast<uint32_t>(v * units), index_max_) : 0;
  }
  // An entry is the bits of a pdf or, with the sign bit set, the number of a block of 4 x 4 entries
  // for the parts of its region.
  static bool IsLink(uint32_t entry) { return entry >> 31 != 0; }
  uint32_t EntryIn(uint32_t link, uint32_t x, uint32_t y) const {
    return blocks_[(link & 0x7fffffff) * 16 + y % 4 * 4 + x % 4];
  }
  void SetCumulative(const std::vector<double>& weights);
  // level: height of the square above a unit. Reads the next square, too.
  float PdfOf(const Square& square, int level) const {
    return static_cast<float>((&square)[1].begin - square.begin) *
           pdf_scales_[static_cast<size_t>(level)];
  }
  void SetPdf(uint32_t x, uint32_t y, uint32_t side, float pdf);
  // Returns the index of the first entry of an entry's block; creates the block if there is none.
  size_t BlockOf(uint32_t* entry);

  int level_count_ = 0;  // Levels of the quadtree below its root.
  // By level: 1 / (kProbabilityOne * a square's fraction of the map).
  std::vector<float> pdf_scales_;
  uint32_t index_max_ = 0;
  uint32_t cells_across_ = 0;
  int guide_shift_ = 0;
  double second_moment_ratio_ = 1;
  std::vector<Square> squares_;  // Plus one, which ends the last.
  std::vector<uint32_t> guide_;  // By the leading bits of a cumulative probability: its square.
  std::vector<uint32_t> grid_;   // Entries, [cells_across_][cells_across_].
  std::vector<uint32_t> blocks_;
};

}  // namespace sheaf::render
