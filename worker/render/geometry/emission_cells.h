// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The grid that cuts a triangle with an emission image into count * count congruent cells: rows of
// constant v, each of alternating upright and inverted cells.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "common/math/vec.h"

namespace sheaf::render {

// Returns the cell that contains the point of barycentric coordinates u (of the second corner) and
// v (of the third); the nearest cell where rounding put the point outside.
inline uint32_t CellAt(uint32_t count, double u, double v) {
  const double last = count - 1, x = u * count, y = v * count;
  const double row = std::clamp(std::floor(y), 0.0, last);
  const double column = std::clamp(std::floor(x), 0.0, last - row);
  const bool inverted = (x - column) + (y - row) > 1 && column < last - row;
  const auto r = static_cast<uint32_t>(row), c = static_cast<uint32_t>(column);
  return r * (2 * count - r) + 2 * c + (inverted ? 1 : 0);
}

// Returns the corners (u, v) of the cell, wound like the triangle. Requires: cell < count * count.
inline std::array<Vec2d, 3> CellCorners(uint32_t count, uint32_t cell) {
  uint32_t row = 0;
  while (cell >= (row + 1) * (2 * count - row - 1)) ++row;
  const uint32_t in_row = cell - row * (2 * count - row);
  const double x = in_row / 2, y = row, size = 1.0 / count;
  if (in_row % 2 == 0) return {Vec2d{x, y} * size, Vec2d{x + 1, y} * size, Vec2d{x, y + 1} * size};
  return {Vec2d{x + 1, y + 1} * size, Vec2d{x, y + 1} * size, Vec2d{x + 1, y} * size};
}

}  // namespace sheaf::render
