// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MajorantWalk: traversal of the cells of a MajorantGrid by a ray; and the numbers of the cells.
#include <algorithm>
#include <cmath>
#include <limits>

#include "worker/render/medium/majorant_grid.h"

namespace sheaf::render {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

}  // namespace

MajorantWalk::MajorantWalk(const MajorantGrid& grid, Vec3d o, Vec3d d, double t_min, double t_max)
    : grid_(grid), o_(o), d_(d), t_(t_min), t_box_begin_(t_min), t_box_end_(t_max), t_max_(t_max) {
  bool intersects = !grid.nodes_.empty();
  for (size_t a = 0; a < 3; ++a) {
    inverse_d_[a] = 1 / d[a];
    // If the inverse overflows, the ray does not move along this axis.
    if (!std::isfinite(inverse_d_[a])) {
      d_[a] = 0;
      intersects &= o[a] >= grid.box_.lo[a] && o[a] <= grid.box_.hi[a];
      continue;
    }
    const double t_lo = (grid.box_.lo[a] - o[a]) * inverse_d_[a];
    const double t_hi = (grid.box_.hi[a] - o[a]) * inverse_d_[a];
    t_box_begin_ = std::max(t_box_begin_, std::min(t_lo, t_hi));
    t_box_end_ = std::min(t_box_end_, std::max(t_lo, t_hi));
  }
  if (!intersects || !(t_box_begin_ < t_box_end_)) {
    phase_ = Phase::kAfter;
    return;
  }
  for (size_t a = 0; a < 3; ++a) {
    const double p = std::floor(o_[a] + (d_[a] == 0 ? 0 : t_box_begin_ * d_[a]));
    const double low = grid.cell_min_[a], high = grid.cell_max_[a];
    cell_[a] = static_cast<int32_t>(std::min(std::max(p, low), high));
  }
}

bool MajorantWalk::Next(MajorantSegment* segment) {
  if (phase_ == Phase::kBefore) {
    phase_ = Phase::kInside;
    if (t_ < t_box_begin_) {
      *segment = {t_, t_box_begin_, {}};
      t_ = t_box_begin_;
      return true;
    }
  }
  if (phase_ == Phase::kInside && NextInside(segment)) return true;
  if (phase_ == Phase::kAfter) {
    phase_ = Phase::kDone;
    if (t_ < t_max_) {
      *segment = {t_, t_max_, {}};
      t_ = t_max_;
      return true;
    }
  }
  return false;
}

bool MajorantWalk::NextInside(MajorantSegment* segment) {
  while (phase_ == Phase::kInside) {
    Index3 lo;
    int32_t size;
    const DensityBounds bounds = FindCell(&lo, &size);
    double exit = kInfinity;
    size_t axis = 3;
    for (size_t a = 0; a < 3; ++a) {
      if (d_[a] == 0) continue;
      const double plane = d_[a] > 0 ? lo[a] + size : lo[a];
      const double t = (plane - o_[a]) * inverse_d_[a];
      if (t < exit) {
        exit = t;
        axis = a;
      }
    }
    const double begin = t_;
    if (axis == 3 || exit >= t_box_end_) {
      t_ = t_box_end_;
      phase_ = Phase::kAfter;
    } else {
      t_ = std::max(t_, exit);
      Leave(axis, lo, size);
      // The walk has left the last cell; any remaining length is rounding and belongs to that cell.
      if (phase_ == Phase::kAfter) t_ = t_box_end_;
    }
    if (begin < t_) {
      *segment = {begin, t_, bounds};
      return true;
    }
  }
  return false;
}

void MajorantWalk::Leave(size_t axis, Index3 lo, int32_t size) {
  for (size_t a = 0; a < 3; ++a) {
    if (d_[a] == 0) continue;
    if (a == axis) {
      cell_[a] = d_[a] > 0 ? lo[a] + size : lo[a] - 1;
      if (cell_[a] < grid_.cell_min_[a] || cell_[a] > grid_.cell_max_[a]) phase_ = Phase::kAfter;
      continue;
    }
    // The cell of the point, clamped to the cell just left and to forward movement.
    const double p = std::floor(o_[a] + t_ * d_[a]);
    const double low = d_[a] > 0 ? cell_[a] : lo[a];
    const double high = d_[a] > 0 ? lo[a] + size - 1 : cell_[a];
    cell_[a] = static_cast<int32_t>(std::min(std::max(p, low), high));
    cell_[a] = std::clamp(cell_[a], grid_.cell_min_[a], grid_.cell_max_[a]);
  }
}

DensityBounds MajorantWalk::FindCell(Index3* lo, int32_t* size) const {
  const auto x = static_cast<uint32_t>(cell_[0] - grid_.origin_[0]);
  const auto y = static_cast<uint32_t>(cell_[1] - grid_.origin_[1]);
  const auto z = static_cast<uint32_t>(cell_[2] - grid_.origin_[2]);
  const auto child = [&](int32_t shift) {
    return (((x >> shift) & 3) << 4) | (((y >> shift) & 3) << 2) | ((z >> shift) & 3);
  };
  const auto place = [&](int32_t shift) {
    *size = 1 << shift;
    for (size_t a = 0; a < 3; ++a) {
      (*lo)[a] = cell_[a] - ((cell_[a] - grid_.origin_[a]) & (*size - 1));
    }
  };
  const MajorantGrid::Node* node = grid_.nodes_.data();
  int32_t shift = 3 + 2 * (grid_.levels_ - 1);
  for (;; shift -= 2) {
    const MajorantGrid::Child& c = (*node)[child(shift)];
    if (c.link == 0) {
      place(shift);
      return c.bounds;
    }
    if (shift == 3) {
      place(1);
      return grid_.bricks_[c.link - 1][child(1)];
    }
    node = &grid_.nodes_[c.link - 1];
  }
}

MajorantGrid::Cell MajorantGrid::CellAt(Vec3d p) const {
  Index3 voxel, local;
  for (size_t a = 0; a < 3; ++a) {
    const double low = cell_min_[a], high = cell_max_[a];
    voxel[a] = static_cast<int32_t>(std::min(std::max(std::floor(p[a]), low), high));
    local[a] = voxel[a] - origin_[a];
  }
  uint32_t node = 0;
  for (int32_t shift = 3 + 2 * (levels_ - 1);; shift -= 2) {
    uint32_t n = 0;
    for (const int32_t x : local) n = (n << 2) | static_cast<uint32_t>((x >> shift) & 3);
    const Child& child = nodes_[node][n];
    if (child.link == 0 || shift == 3) {
      const int32_t size = child.link == 0 ? 1 << shift : 2;
      Cell cell{64 * node + n, {}, size, child.bounds};
      if (child.link != 0) {
        n = 0;
        for (const int32_t x : local) n = (n << 2) | static_cast<uint32_t>((x >> 1) & 3);
        cell.id = static_cast<uint32_t>(64 * (nodes_.size() + child.link - 1) + n);
        cell.bounds = bricks_[child.link - 1][n];
      }
      for (size_t a = 0; a < 3; ++a) cell.lo[a] = voxel[a] - (local[a] & (size - 1));
      return cell;
    }
    node = child.link - 1;
  }
}

void MajorantGrid::AddCells(uint32_t node, Index3 origin, int32_t shift,
                            std::vector<Cell>* cells) const {
  const auto corner = [](Index3 from, uint32_t n, int32_t log2) {
    const auto step = [log2](uint32_t k) { return static_cast<int32_t>((k & 3) << log2); };
    return Index3{from[0] + step(n >> 4), from[1] + step(n >> 2), from[2] + step(n)};
  };
  for (uint32_t n = 0; n < 64; ++n) {
    const Child& child = nodes_[node][n];
    const Index3 lo = corner(origin, n, shift);
    if (child.link == 0) {
      cells->push_back({64 * node + n, lo, 1 << shift, child.bounds});
    } else if (shift > 3) {
      AddCells(child.link - 1, lo, shift - 2, cells);
    } else {
      const auto first = static_cast<uint32_t>(64 * (nodes_.size() + child.link - 1));
      for (uint32_t k = 0; k < 64; ++k) {
        cells->push_back({first + k, corner(lo, k, 1), 2, bricks_[child.link - 1][k]});
      }
    }
  }
}

std::vector<MajorantGrid::Cell> MajorantGrid::Cells() const {
  std::vector<Cell> cells;
  if (!nodes_.empty()) AddCells(0, origin_, 3 + 2 * (levels_ - 1), &cells);
  return cells;
}

}  // namespace sheaf::render
