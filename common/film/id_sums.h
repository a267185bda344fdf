// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// IdSums: the ids of the objects visible in a tile's pixels, and their weights. A pixel has few of
// a scene's many ids, so it keeps a list of those it hit; an absent id has weight 0. Each weight is
// a sum along the canonical tree (film_tile.h) like any other.
//
// The list's length is bounded at every node of the tree: the excess is moved to one entry for all
// dropped ids. Nodes do not depend on how the work was divided, so neither do the dropped ids.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace sheaf {

// Ids are numbers from 1 that a scene assigns to its objects, up to kIdMax, so that a float can
// hold them.
inline constexpr uint32_t kNoId = 0;
inline constexpr uint32_t kIdMax = (1u << 24) - 2;
// A pixel keeps the ids with the most weight. The weight of all others is added to kNoId.
inline constexpr size_t kIdsPerPixelMax = 128;

struct IdWeight {
  uint32_t id = kNoId;
  double weight = 0;  // The value of a DoubleFloat.
  friend bool operator==(const IdWeight&, const IdWeight&) = default;
};
// Ascending by id, each id once.
using IdList = std::vector<IdWeight>;

// *left becomes the node over both. scratch: memory to reuse; its content does not matter.
void MergeIds(const IdList& right, IdList* left, IdList* scratch);

struct IdSums {
  std::vector<IdList> pixels;             // Row-major over the tile's rect; empty if not requested.
  std::map<uint32_t, std::string> names;  // Names of all ids in `pixels` except kNoId.

  size_t size_bytes() const;
  friend bool operator==(const IdSums&, const IdSums&) = default;
};

}  // namespace sheaf
