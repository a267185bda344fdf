// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Functions over the unit square, tabulated at the corners of a grid and bilinear between, one for
// each of a few directions of incidence and blended between those; and the warps that densities of
// this kind are sampled by. Source: Dupuy and Jakob 2018, "An Adaptive Parameterization for
// Efficient Material Acquisition and Rendering", sec. 4.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/base/vector_bytes.h"
#include "common/math/vec.h"

namespace sheaf::render {

// Where a direction of incidence lies among those that were measured: up to four of them, with
// weights that add up to 1.
struct SliceBlend {
  std::array<uint32_t, 4> slice{};
  std::array<float, 4> weight{};
  size_t count = 0;
};

// Position on an axis of increasing values; the ends hold beyond them. Requires: not empty.
struct AxisPosition {
  uint32_t index = 0;  // Of the value below.
  float fraction = 0;  // Towards the next, which exists where this is not 0.
};
AxisPosition FindOnAxis(const std::vector<float>& axis, float value);
// Slices lie [phi][theta].
SliceBlend BlendSlices(const std::vector<float>& phi_axis, const std::vector<float>& theta_axis,
                       float phi, float theta);

// A cell of a grid and where in it.
struct CellPosition {
  uint32_t column = 0, row = 0;
  Vec2f at;  // In [0, 1]^2.
};
// p is clamped to [0, 1]^2. Requires: width, height >= 2.
CellPosition FindCell(uint32_t width, uint32_t height, Vec2f p);

// Values at corners: one function.
class BilinearGrid {
 public:
  BilinearGrid() = default;
  // values: [height][width]. Requires: width, height >= 2.
  BilinearGrid(uint32_t width, uint32_t height, std::vector<float> values)
      : width_(width), height_(height), values_(std::move(values)) {}
  float At(Vec2f p) const;
  uint64_t memory_bytes() const { return VectorBytes(values_); }

 private:
  uint32_t width_ = 0, height_ = 0;
  std::vector<float> values_;
};

// A density over the unit square for each direction of incidence.
class WarpTable {
 public:
  struct Point {
    Vec2f p;
    float pdf = 0;  // 0: there is none.
  };

  WarpTable() = default;
  // densities: [slice][height][width], each slice normalised here. A slice that is black becomes
  // uniform. Requires: width, height >= 2; values are finite and not negative.
  WarpTable(uint32_t width, uint32_t height, std::vector<float> densities);

  // A point with the density that `blend` describes, and that density. u in [0, 1)^2.
  Point Sample(const SliceBlend& blend, Vec2f u) const;
  // The u that Sample takes to p, and p's density.
  Point Invert(const SliceBlend& blend, Vec2f p) const;
  float Pdf(const SliceBlend& blend, Vec2f p) const;
  uint64_t memory_bytes() const { return VectorBytes(values_, line_sums_, row_sums_); }

 private:
  // Blended values: of the density at two corners of a row, and of the sums.
  struct Row {
    float below = 0, above = 0;  // Integrals over two lines of corners.
  };
  float Blend(const SliceBlend& blend, const std::vector<float>& table, size_t per_slice,
              size_t index) const;
  Row RowAt(const SliceBlend& blend, uint32_t row) const;
  // Of the line at height y in that row: its integral up to a column.
  float LineSum(const SliceBlend& blend, uint32_t row, float y, uint32_t column) const;
  float LineValue(const SliceBlend& blend, uint32_t row, float y, uint32_t column) const;

  uint32_t width_ = 0, height_ = 0;
  std::vector<float> values_;     // [slice][height][width], of integral 1 over cells of size 1.
  std::vector<float> line_sums_;  // Likewise: integrals along each line, up to the column.
  std::vector<float> row_sums_;   // [slice][height]: over all rows below.
};

}  // namespace sheaf::render
