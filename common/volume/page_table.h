// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PageTable: the index of a grid's pages, as a walk over the grid's nodes makes it. Each leaf adds
// its values to the ranges of the 27 blocks whose lookups reach it, so that the walk meets it once;
// tiles, which are few values, are added at the end.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <unordered_map>
#include <vector>

#include "common/volume/page_format.h"
#include "common/volume/paged_grid.h"

namespace sheaf::volume {

// Not thread-safe. Keys of root tiles, regions, pages and blocks are origins in units of their
// sides.
class PageTable {
 public:
  // Call first.
  void SetBackground(float value) { background_ = value; }
  // False if the place in the root was known.
  bool AddRoot(Index3 key) { return root_values_.emplace(key, std::nullopt).second; }
  void SetRootValue(Index3 key, float value);
  // The voxels of a region that no page or entry describes have the value.
  void AddRegion(Index3 key, float value) { RegionAt(key, value); }
  void AddLeaf(Index3 block, std::span<const float, 512> values);
  // A page of the walk: the values of its blocks that are no leaves, and which are leaves. *entry:
  // its entry, until the next call; null if it has none. Requires: its region was added.
  void SetPage(Index3 key, const std::array<float, kBlocks>& tiles, uint32_t mask,
               PageEntry** entry);
  // The index, whose head has only the counts and the background.
  PageIndex Finish();

 private:
  void Widen(Index3 block, ValueRange range);
  // The place of the entry or region, which is made if there is none.
  uint32_t EntryAt(Index3 key);
  uint32_t RegionAt(Index3 key, float value);
  // The value of a page without tiles of its own.
  float ValueOfPage(Index3 key) const;
  // The value of a block that is no leaf.
  std::optional<float> TileOf(Index3 block) const;
  // Completes entries that leaves made and the walk did not meet, or met before.
  void FillTiles();
  void FillRanges();
  void LinkPages();

  PageIndex index_{};
  std::unordered_map<Index3, uint32_t, Index3Hash> entry_of_, region_of_;
  std::map<Index3, std::optional<float>> root_values_;  // Without a value: an upper node.
  std::vector<bool> has_tiles_;                         // The walk set the tiles of the entry.
  size_t last_place_ = 0;
  float background_ = 0;
};

}  // namespace sheaf::volume
