// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// IdSums: which things a tile's pixels show, and by how much weight. A pixel has few of a scene's
// many ids, so it keeps a list of those it met; an id that is not there has weight 0. Each weight
// is a sum along the canonical tree (film_tile.h) like any other.
//
// The list's length is bounded at every node of the tree: what a node has too much goes to one
// entry for all the rest. As nodes are the same however the work was cut, so is what they give up.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace sheaf {

// Ids are numbers from 1 that a scene gives to its things: up to kIdMax, so that a float holds
// them.
inline constexpr uint32_t kNoId = 0;
inline constexpr uint32_t kIdMax = (1u << 24) - 2;
// Ids of one pixel, those with the most weight. The weight of others is counted to kNoId.
inline constexpr size_t kIdsPerPixelMax = 128;

struct IdWeight {
  uint32_t id = kNoId;
  double weight = 0;  // A DoubleFloat's value.
  friend bool operator==(const IdWeight&, const IdWeight&) = default;
};
// Ascending by id, each id once.
using IdList = std::vector<IdWeight>;

// *left becomes the node over both. scratch: memory to use, its content does not matter.
void MergeIds(const IdList& right, IdList* left, IdList* scratch);

struct IdSums {
  std::vector<IdList> pixels;             // Row-major over the tile's rect; empty if unasked.
  std::map<uint32_t, std::string> names;  // Of all ids in `pixels` but kNoId.

  size_t size_bytes() const;
  friend bool operator==(const IdSums&, const IdSums&) = default;
};

}  // namespace sheaf
