// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VolumeCells: a box in render space, cut into equal cells, and a ray's way through them. The
// emission of a density is known by cells: EmissiveVolumeSampler and EmissionPoints sample them.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/medium/heterogeneous_medium.h"
#include "worker/render/medium/medium_emission.h"

namespace sheaf::render {

struct VolumeCells {
  Affine cell_from_render, render_from_cell;  // Cells are unit cubes that start at the origin.
  std::array<int32_t, 3> counts{1, 1, 1};

  size_t size() const {
    return static_cast<size_t>(counts[0]) * static_cast<size_t>(counts[1]) *
           static_cast<size_t>(counts[2]);
  }
  // x slowest.
  size_t IndexOf(const std::array<int32_t, 3>& cell) const {
    return (static_cast<size_t>(cell[0]) * static_cast<size_t>(counts[1]) +
            static_cast<size_t>(cell[1])) *
               static_cast<size_t>(counts[2]) +
           static_cast<size_t>(cell[2]);
  }
  double VolumeOfCell() const { return std::fabs(render_from_cell.Determinant()); }
  // The point of a cell with the coordinates `at` in it, each in [0, 1).
  Vec3d PointIn(size_t index, Vec3d at) const;
  // The cell of a point of render space; none outside.
  std::optional<size_t> CellAt(Vec3d p) const;
  // Calls visit(index, t0, t1), t0 < t1, for each cell that p + t w crosses for t > 0, in order.
  // Source: Amanatides and Woo 1987.
  template <typename Visit>
  void Walk(Vec3d p, Vec3d w, const Visit& visit) const;
};

// Cuts the medium's box into cells that are close to cubes, `across` along its longest side.
VolumeCells CutIntoCells(const HeterogeneousMedium& medium, int32_t across);

// An emissive density. Both must outlive its use.
struct EmissiveDensity {
  const HeterogeneousMedium* density = nullptr;
  const MediumEmission* emission = nullptr;
  Rgb sigma_a;  // For a density of 1.
};
// Maximum number of points evaluated in all cells of a density.
inline constexpr int64_t kEmissionPlacesMax = int64_t{1} << 18;
// Number of times at which the emission of a moving density is evaluated.
inline constexpr int kEmissionMoments = 4;
// The luminance that each cell emits per solid angle, estimated at the centers of equal parts of
// the cell and of the shutter interval. Finite, not negative.
std::vector<double> EmissionOfCells(const EmissiveDensity& source, const VolumeCells& cells);

template <typename Visit>
void VolumeCells::Walk(Vec3d p, Vec3d w, const Visit& visit) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Vec3d o = cell_from_render.Point(p), d = cell_from_render.Vector(w);
  double t = 0, end = kInfinity;
  for (size_t a = 0; a < 3; ++a) {
    const double size = counts[a];
    if (d[a] == 0) {
      if (!(o[a] >= 0 && o[a] <= size)) return;
      continue;
    }
    const double first = -o[a] / d[a], last = (size - o[a]) / d[a];
    t = std::max(t, std::min(first, last));
    end = std::min(end, std::max(first, last));
  }
  if (!(t < end)) return;
  std::array<int32_t, 3> cell{};
  for (size_t a = 0; a < 3; ++a) {
    const double at = std::clamp(std::floor(o[a] + t * d[a]), 0.0, counts[a] - 1.0);
    cell[a] = static_cast<int32_t>(at);
  }
  for (;;) {
    // Where the ray leaves the cell, and through which face.
    double next = end;
    size_t axis = 3;
    for (size_t a = 0; a < 3; ++a) {
      if (d[a] == 0) continue;
      const double side = (cell[a] + (d[a] > 0 ? 1 : 0) - o[a]) / d[a];
      if (side < next) {
        next = side;
        axis = a;
      }
    }
    if (next > t) {
      visit(IndexOf(cell), t, next);
      t = next;
    }
    if (axis == 3) return;
    cell[axis] += d[axis] > 0 ? 1 : -1;
    if (cell[axis] < 0 || cell[axis] >= counts[axis]) return;
  }
}

}  // namespace sheaf::render
