// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampling/map_partition.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "worker/render/sampling/discrete_distribution.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

// Amount by which one more square must lower the square root of the second moment, relative to its
// minimum.
constexpr double kPriceOfSquare = 0x1p-18;

// Integrals of the map and of its square over a region. Unit of area: one texel.
struct Moments {
  double sum = 0, sum_of_squares = 0;
  void Add(const Moments& m) {
    sum += m.sum;
    sum_of_squares += m.sum_of_squares;
  }
};

// Values at the corners of a region where the map is bilinear: [y][x].
using Corners = std::array<std::array<double, 2>, 2>;

// Number: double, or a vector of them for several regions at once.
template <typename Number>
Number MeanSquareOf(Number a, Number b, Number d, Number e) {
  return (a * a + b * b + d * d + e * e + (a + e) * (b + d)) / 9 + (a * e + b * d) / 18;
}
Moments MomentsOf(const Corners& c, double area) {
  const double a = c[0][0], b = c[0][1], d = c[1][0], e = c[1][1];
  return {area * ((a + b + d + e) / 4), area * MeanSquareOf(a, b, d, e)};
}
// The sum of the moments of a texel's quarters, of its values at the center, on the middle of edges
// and at the corners: [y][x].
Moments MomentsOfQuarters(const std::array<std::array<double, 3>, 3>& l) {
  using Quarters [[gnu::vector_size(32)]] = double;
  const Quarters a{l[0][0], l[0][1], l[1][0], l[1][1]}, b{l[0][1], l[0][2], l[1][1], l[1][2]},
      d{l[1][0], l[1][1], l[2][0], l[2][1]}, e{l[1][1], l[1][2], l[2][1], l[2][2]};
  const Quarters mean = (a + b + d + e) / 4, mean_square = MeanSquareOf(a, b, d, e);
  Moments sum;
  for (int i = 0; i < 4; ++i) sum.Add({0.25 * mean[i], 0.25 * mean_square[i]});
  return sum;
}

// Hilbert's curve through the quadrants of a square: the quadrant, and the curve's variant in it.
struct Quadrant {
  uint32_t x, y;
  uint32_t curve;
};
constexpr Quadrant kCurves[4][4] = {{{0, 0, 1}, {0, 1, 0}, {1, 1, 0}, {1, 0, 2}},
                                    {{0, 0, 0}, {1, 0, 1}, {1, 1, 1}, {0, 1, 3}},
                                    {{1, 1, 3}, {0, 1, 2}, {0, 0, 2}, {1, 0, 0}},
                                    {{1, 1, 2}, {1, 0, 3}, {0, 0, 3}, {0, 1, 1}}};

}  // namespace

// Visits the quadtree depth first along the curve, and merges squares into their parent where that
// is better. Coordinates and sides in units.
class MapPartitionBuilder {
 public:
  struct Leaf {
    uint32_t x, y, side;
  };
  MapPartitionBuilder(int size, const std::vector<float>& values)
      : size_(static_cast<uint32_t>(size)), values_(values) {
    double total = 0;
    for (const float value : values) total += static_cast<double>(value);
    price_ = total * kPriceOfSquare;
  }
  Moments Build() {
    constexpr uint32_t kUnits = MapPartition::kUnits;
    return AddSquare({0, 0, std::bit_ceil(size_) * kUnits}, 0).moments;
  }
  const std::vector<Leaf>& leaves() const { return leaves_; }
  // area * rms of each leaf.
  const std::vector<double>& weights() const { return weights_; }

 private:
  struct Best {
    Moments moments;
    double cost = 0;
  };

  Best AddSquare(Leaf square, uint32_t curve) {
    constexpr uint32_t kUnits = MapPartition::kUnits;
    if (square.x >= size_ * kUnits || square.y >= size_ * kUnits) return {};
    if (square.side == kUnits) return AddTexel(square, curve);
    const size_t mark = leaves_.size();
    Best parts;
    for (const Quadrant& quadrant : kCurves[curve]) {
      const Best part = AddSquare(PartOf(square, quadrant), quadrant.curve);
      parts.moments.Add(part.moments);
      parts.cost += part.cost;
    }
    const bool is_inside = std::max(square.x, square.y) + square.side <= size_ * kUnits;
    return is_inside ? Better(square, parts, mark) : parts;
  }

  Best AddTexel(Leaf texel, uint32_t curve) {
    constexpr uint32_t kUnits = MapPartition::kUnits;
    const int tx = static_cast<int>(texel.x / kUnits), ty = static_cast<int>(texel.y / kUnits);
    // At the center, on the middle of edges, and at the corners.
    std::array<std::array<double, 3>, 3> l;
    const int last = static_cast<int>(size_) - 1;
    if (tx > 0 && ty > 0 && tx < last && ty < last) {
      const float* row = &values_[(texel.y / kUnits - 1) * size_t{size_} + texel.x / kUnits - 1];
      for (int y = 0; y < 3; ++y, row += size_) {
        for (int x = 0; x < 3; ++x) l[y][x] = static_cast<double>(row[x]);
      }
    } else {
      for (int y = 0; y < 3; ++y) {
        for (int x = 0; x < 3; ++x) l[y][x] = At(tx + x - 1, ty + y - 1);
      }
    }
    const double c = l[1][1];
    l = {{{(l[0][0] + l[0][1] + l[1][0] + c) / 4, (l[0][1] + c) / 2,
           (l[0][1] + l[0][2] + c + l[1][2]) / 4},
          {(l[1][0] + c) / 2, c, (c + l[1][2]) / 2},
          {(l[1][0] + c + l[2][0] + l[2][1]) / 4, (c + l[2][1]) / 2,
           (c + l[1][2] + l[2][1] + l[2][2]) / 4}}};
    const auto corners = [&](uint32_t x, uint32_t y) {
      return Corners{{{l[y][x], l[y][x + 1]}, {l[y + 1][x], l[y + 1][x + 1]}}};
    };
    Best best;
    best.moments = MomentsOfQuarters(l);
    if (!MayBeWorthSplitting(best.moments, 1)) return AddLeaf(texel, best.moments);
    const size_t mark = leaves_.size();
    for (const Quadrant& quadrant : kCurves[curve]) {
      best.cost +=
          AddQuarter(PartOf(texel, quadrant), corners(quadrant.x, quadrant.y), quadrant.curve).cost;
    }
    return Better(texel, best, mark);
  }

  // A quarter of a texel, in which the map is bilinear.
  Best AddQuarter(Leaf quarter, const Corners& c, uint32_t curve) {
    Best best{MomentsOf(c, 0.25), 0};
    if (!MayBeWorthSplitting(best.moments, 0.25)) return AddLeaf(quarter, best.moments);
    const size_t mark = leaves_.size();
    const auto at = [&](uint32_t x, uint32_t y) {
      const double fx = 0.5 * x, fy = 0.5 * y;
      return (1 - fy) * ((1 - fx) * c[0][0] + fx * c[0][1]) +
             fy * ((1 - fx) * c[1][0] + fx * c[1][1]);
    };
    for (const Quadrant& q : kCurves[curve]) {
      const Corners part{
          {{at(q.x, q.y), at(q.x + 1, q.y)}, {at(q.x, q.y + 1), at(q.x + 1, q.y + 1)}}};
      best.cost += AddLeaf(PartOf(quarter, q), MomentsOf(part, 0.0625)).cost;
    }
    return Better(quarter, best, mark);
  }

  // The cost of the parts is at least the sum plus the price of three more squares.
  bool MayBeWorthSplitting(const Moments& m, double area) const {
    return std::sqrt(area * m.sum_of_squares) - m.sum > 3 * price_;
  }
  static double AreaOf(const Leaf& leaf) {
    const double side = static_cast<double>(leaf.side) / MapPartition::kUnits;
    return side * side;
  }
  // Keeps either the square itself or its parts, the leaves from `mark` on.
  Best Better(const Leaf& square, const Best& parts, size_t mark) {
    const double weight = std::sqrt(AreaOf(square) * parts.moments.sum_of_squares);
    if (parts.cost < weight + price_) return parts;
    leaves_.resize(mark);
    weights_.resize(mark);
    return AddLeaf(square, parts.moments);
  }
  Best AddLeaf(const Leaf& leaf, const Moments& moments) {
    const double weight = std::sqrt(AreaOf(leaf) * moments.sum_of_squares);
    if (!(weight > 0)) return {moments, 0};
    leaves_.push_back(leaf);
    weights_.push_back(weight);
    return {moments, weight + price_};
  }
  static Leaf PartOf(const Leaf& square, const Quadrant& quadrant) {
    const uint32_t side = square.side / 2;
    return {square.x + quadrant.x * side, square.y + quadrant.y * side, side};
  }
  double At(int x, int y) const {
    const TexelPosition wrapped = WrapOctahedral({x, y}, static_cast<int>(size_));
    return static_cast<double>(
        values_[static_cast<size_t>(wrapped.y) * size_ + static_cast<size_t>(wrapped.x)]);
  }

  uint32_t size_;
  const std::vector<float>& values_;
  double price_ = 0;
  std::vector<Leaf> leaves_;
  std::vector<double> weights_;
};

MapPartition::MapPartition(int size, const std::vector<float>& values)
    : index_max_(static_cast<uint32_t>(size) * kUnits - 1),
      cells_across_((static_cast<uint32_t>(size) * kUnits + kCellSide - 1) / kCellSide) {
  MapPartitionBuilder builder(size, values);
  const Moments moments = builder.Build();
  if (builder.leaves().empty()) return;
  level_count_ = std::countr_zero(std::bit_ceil(index_max_ + 1));
  for (const MapPartitionBuilder::Leaf& leaf : builder.leaves()) {
    const uint32_t depth = static_cast<uint32_t>(level_count_ - std::countr_zero(leaf.side));
    const uint32_t x = leaf.x / leaf.side, y = leaf.y / leaf.side;
    squares_.push_back({0, (((1u << depth) | x) << depth) | y});
  }
  squares_.push_back({kProbabilityOne, 1});
  SetCumulative(builder.weights());
  const double area = static_cast<double>(size) * static_cast<double>(size);
  double root = 0;
  for (const double weight : builder.weights()) root += weight;
  second_moment_ratio_ = root * root / (moments.sum * moments.sum);
  for (int level = 0; level <= level_count_; ++level) {
    const double side = std::ldexp(1.0 / kUnits, level);
    pdf_scales_.push_back(static_cast<float>(area / (side * side * kProbabilityOne)));
  }
  grid_.resize(static_cast<size_t>(cells_across_) * cells_across_);
  for (size_t i = 0; i + 1 < squares_.size(); ++i) {
    const MapPartitionBuilder::Leaf& leaf = builder.leaves()[i];
    SetPdf(leaf.x, leaf.y, leaf.side, PdfOf(squares_[i], std::countr_zero(leaf.side)));
  }
}

// Every square gets one unit of probability plus its fraction of the remainder.
void MapPartition::SetCumulative(const std::vector<double>& weights) {
  double total = 0;
  for (const double weight : weights) total += weight;
  const double scale =
      (static_cast<double>(kProbabilityOne) - static_cast<double>(weights.size())) / total;
  double before = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    squares_[i].begin = static_cast<uint32_t>(before * scale) + static_cast<uint32_t>(i);
    before += weights[i];
  }
  // A few squares per entry: the search continues along a cache line.
  const int bits = std::max(static_cast<int>(std::bit_width(weights.size())) - 2, 0);
  guide_shift_ = 31 - bits;
  guide_.resize(size_t{1} << bits);
  uint32_t square = 0;
  for (size_t i = 0; i < guide_.size(); ++i) {
    while (squares_[square + 1].begin <= i << guide_shift_) ++square;
    guide_[i] = square;
  }
}

void MapPartition::SetPdf(uint32_t x, uint32_t y, uint32_t side, float pdf) {
  const auto bits = std::bit_cast<uint32_t>(pdf);
  if (side >= kCellSide) {
    for (uint32_t cy = y / kCellSide; cy < (y + side) / kCellSide; ++cy) {
      for (uint32_t cx = x / kCellSide; cx < (x + side) / kCellSide; ++cx) {
        grid_[static_cast<size_t>(cy) * cells_across_ + cx] = bits;
      }
    }
    return;
  }
  size_t block =
      BlockOf(&grid_[static_cast<size_t>(y / kCellSide) * cells_across_ + x / kCellSide]);
  uint32_t part = kUnits;  // Side of the block's entries.
  if (side < kUnits) {
    const size_t texel = block + y / kUnits % 4 * 4 + x / kUnits % 4;
    uint32_t entry = blocks_[texel];  // A copy, because the blocks may move.
    block = BlockOf(&entry);
    blocks_[texel] = entry;
    part = 1;
  }
  for (uint32_t py = y / part; py < (y + side) / part; ++py) {
    for (uint32_t px = x / part; px < (x + side) / part; ++px) {
      blocks_[block + py % 4 * 4 + px % 4] = bits;
    }
  }
}

size_t MapPartition::BlockOf(uint32_t* entry) {
  if (!IsLink(*entry)) {
    *entry = static_cast<uint32_t>(blocks_.size() / 16) | 0x80000000u;
    blocks_.resize(blocks_.size() + 16);
  }
  return static_cast<size_t>(*entry & 0x7fffffff) * 16;
}

MapPartition::Choice MapPartition::Choose(Vec2f u) const {
  // Needs more bits than the caller has: a bright point in a dark map has a tiny interval.
  const double v = ExtendBits(u.x, ~SaltOf(u)) * kProbabilityOne;
  const Square* square = &squares_[guide_[static_cast<uint32_t>(v) >> guide_shift_]];
  while (static_cast<double>(square[1].begin) <= v) ++square;
  const double within = (v - square->begin) / (square[1].begin - square->begin);
  const int depth = (static_cast<int>(std::bit_width(square->path)) - 1) / 2;
  const int level = level_count_ - depth;
  const uint32_t mask = (1u << depth) - 1;
  const float side = static_cast<float>(1u << level) * (1.0f / kUnits);
  // Rounding must not reach the next square.
  constexpr float kBelowOne = 1 - 0x1p-24f;
  const auto place = [&](uint32_t index, float fraction) {
    const auto begin = static_cast<float>(index);
    return std::min(begin + fraction, (begin + 1) * kBelowOne) * side;
  };
  return {{place(square->path >> depth & mask, static_cast<float>(within)),
           place(square->path & mask, u.y)},
          PdfOf(*square, level)};
}

size_t MapPartition::size_bytes() const {
  return squares_.size() * sizeof(Square) +
         (guide_.size() + grid_.size() + blocks_.size()) * sizeof(uint32_t);
}

}  // namespace sheaf::render
