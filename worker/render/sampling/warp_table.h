// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// BilinearGrid and WarpTable: functions over the unit square, tabulated at the corners of a grid
// with bilinear interpolation, one per measured direction of incidence and blended between those;
// and the warps that sample densities of this form. Source: Dupuy and Jakob 2018, "An Adaptive
// Parameterization for Efficient Material Acquisition and Rendering", sec. 4.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/base/vector_bytes.h"
#include "common/math/vec.h"

namespace sheaf::render {

// Position of a direction of incidence among the measured ones: up to four of them, with weights
// that sum to 1.
struct SliceBlend {
  std::array<uint32_t, 4> slice{};
  std::array<float, 4> weight{};
  size_t count = 0;
};

// Position on an axis of increasing values, clamped to its ends. Requires: not empty.
struct AxisPosition {
  uint32_t index = 0;  // Index of the value below.
  float fraction = 0;  // Towards the next value, which exists where this is not 0.
};
AxisPosition FindOnAxis(const std::vector<float>& axis, float value);
// Slices are ordered [phi][theta].
SliceBlend BlendSlices(const std::vector<float>& phi_axis, const std::vector<float>& theta_axis,
                       float phi, float theta);

// A grid cell and the position in it.
struct CellPosition {
  uint32_t column = 0, row = 0;
  Vec2f at;  // In [0, 1]^2.
};
// p is clamped to [0, 1]^2. Requires: width, height >= 2.
CellPosition FindCell(uint32_t width, uint32_t height, Vec2f p);

// A bilinear function, given at the corners of a grid.
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

// A density over the unit square per direction of incidence.
class WarpTable {
 public:
  struct Point {
    Vec2f p;
    float pdf = 0;  // 0: there is no point.
  };

  WarpTable() = default;
  // densities: [slice][height][width]; the constructor normalizes each slice. A black slice becomes
  // uniform. Requires: width, height >= 2; values are finite and nonnegative.
  WarpTable(uint32_t width, uint32_t height, std::vector<float> densities);

  // Samples a point of the blended density, with its pdf. u in [0, 1)^2.
  Point Sample(const SliceBlend& blend, Vec2f u) const;
  // Returns the u that Sample maps to p, and the density at p.
  Point Invert(const SliceBlend& blend, Vec2f p) const;
  float Pdf(const SliceBlend& blend, Vec2f p) const;
  uint64_t memory_bytes() const { return VectorBytes(values_, line_sums_, row_sums_); }

 private:
  // Blended integrals over one row of cells.
  struct Row {
    float below = 0, above = 0;  // Integrals along the row's two lines of corners.
  };
  float Blend(const SliceBlend& blend, const std::vector<float>& table, size_t per_slice,
              size_t index) const;
  Row RowAt(const SliceBlend& blend, uint32_t row) const;
  // Integral of the line at height y in the row, up to a column.
  float LineSum(const SliceBlend& blend, uint32_t row, float y, uint32_t column) const;
  float LineValue(const SliceBlend& blend, uint32_t row, float y, uint32_t column) const;

  uint32_t width_ = 0, height_ = 0;
  std::vector<float> values_;     // [slice][height][width], with integral 1 over cells of size 1.
  std::vector<float> line_sums_;  // In the same shape: integrals along each line, up to the column.
  std::vector<float> row_sums_;   // [slice][height]: integrals over all rows below.
};

}  // namespace sheaf::render
