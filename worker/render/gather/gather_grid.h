// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GatherGrid: balls of different radii, and those that contain a place. Cubic cells of the size of
// a power of two, at least a ball's diameter, hold the balls whose centers lie in them; cells are
// found by hashing. All that contain a place lie in the eight cells next to it, for each size.
// Everything scales exactly with powers of two.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::render {

struct GatherBall {
  Vec3f p;
  float radius = 0;
};

// Thread-safe after Build.
class GatherGrid {
 public:
  // Replaces the balls. Those whose center or radius is not finite, or whose radius is not
  // positive, contain nothing.
  void Build(std::span<const GatherBall> balls);

  // Calls visit(index of the ball, squared distance of p to its center) for each ball that contains
  // p, in an order that the balls and p alone determine; balls of one cell in ascending order.
  template <typename Visit>
  void ForEachAround(Vec3f p, const Visit& visit) const {
    if (!IsWithinBounds(p)) return;
    for (const int level : levels_) {
      const std::array<int64_t, 3> base = CellOf(p, level, 0.5);
      for (int64_t corner = 0; corner < 8; ++corner) {
        const Cell* cell = Find(KeyOf(
            {base[0] + (corner & 1), base[1] + (corner >> 1 & 1), base[2] + (corner >> 2)}, level));
        if (cell == nullptr) continue;
        for (uint32_t i = cell->first; i < cell->end; ++i) {
          const Entry& entry = entries_[i];
          const Vec3f d = p - entry.p;
          const float distance_squared = Dot(d, d);
          if (distance_squared < entry.radius_squared) visit(entry.ball, distance_squared);
        }
      }
    }
  }

 private:
  struct Entry {
    Vec3f p;
    float radius_squared = 0;
    uint32_t ball = 0;
  };
  struct Cell {
    uint64_t key = 0;
    uint32_t first = 0, end = 0;  // Empty if both are equal.
  };
  struct Place {
    uint64_t key = 0;
    uint32_t ball = 0;
  };

 public:
  // The most bytes for each ball: an entry, its place in the order, and two to four cells.
  static constexpr uint64_t kPointBytesMax = sizeof(Entry) + sizeof(Place) + 4 * sizeof(Cell);

 private:
  static std::array<int64_t, 3> CellOf(Vec3f p, int level, double shift);
  static uint64_t KeyOf(const std::array<int64_t, 3>& cell, int level);
  bool IsWithinBounds(Vec3f p) const {
    return p.x >= lower_.x && p.x <= upper_.x && p.y >= lower_.y && p.y <= upper_.y &&
           p.z >= lower_.z && p.z <= upper_.z;
  }
  const Cell* Find(uint64_t key) const {
    for (uint64_t at = key & mask_;; at = (at + 1) & mask_) {
      const Cell& cell = cells_[at];
      if (cell.first == cell.end) return nullptr;
      if (cell.key == key) return &cell;
    }
  }
  void AddCell(uint64_t key, uint32_t first, uint32_t end);

  std::vector<int> levels_;  // Exponents of the sizes of cells, ascending.
  std::vector<Place> order_;
  std::vector<Entry> entries_;
  std::vector<Cell> cells_;  // Open addressing; a power of two, at most half full.
  uint64_t mask_ = 0;
  Vec3f lower_{1, 1, 1}, upper_{-1, -1, -1};
};

}  // namespace sheaf::render
