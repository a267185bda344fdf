// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// NearestPoints: the points nearest to a place. Source: Bentley 1975, "Multidimensional Binary
// Search Trees Used for Associative Searching"; the tree is an array whose middle is its root.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::render {

// Thread-safe.
class NearestPoints {
 public:
  struct Item {
    Vec3f p;  // Finite.
    uint32_t id = 0;
  };

  NearestPoints() = default;
  explicit NearestPoints(std::vector<Item> items);

  uint32_t size() const { return static_cast<uint32_t>(items_.size()); }
  // Sets the first of `ids` to those of the points nearest to p: the nearest first, the lower id
  // first at equal distances. Their number, which is less than that of `ids` only where all points
  // are among them. Requires: ids has at most kNearestMax elements.
  uint32_t Find(Vec3f p, std::span<uint32_t> ids) const;

  static constexpr uint32_t kNearestMax = 16;

 private:
  struct Search;

  void Divide(uint32_t first, uint32_t end);
  void Visit(uint32_t first, uint32_t end, Search* search) const;

  std::vector<Item> items_;
  std::vector<uint8_t> axes_;  // Along which the item divides its range.
};

}  // namespace sheaf::render
