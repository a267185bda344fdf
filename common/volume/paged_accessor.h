// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PagedAccessor: looks up the leaves of a PagedGrid, with the functions of NanoVDB's ReadAccessor
// that grid_lookup.h needs. It keeps eight pages pinned, as many as a point of interpolation may
// touch, so that a walk takes no lock and counts no pin while it stays among them.
#pragma once

#include <array>
#include <cstddef>

#include "common/volume/nanovdb_door.h"
#include "common/volume/paged_grid.h"

namespace sheaf::volume {

// Not thread-safe.
class PagedPins {
 public:
  explicit PagedPins(const PagedGrid& grid) : grid_(grid) {}
  ~PagedPins() {
    for (PageSlot* slot : slots_) {
      if (slot != nullptr) VolumePages::Unpin(slot);
    }
    if (pin_count_ > 0) grid_.pages().CountPins(pin_count_);
  }
  PagedPins(const PagedPins&) = delete;
  PagedPins& operator=(const PagedPins&) = delete;

  const PagedGrid& grid() const { return grid_; }
  // The page that the voxel is in; null if it has no leaf. Valid until the next call.
  const PageSlot* PageOf(Index3 voxel) {
    const Index3 key = Shifted(voxel, kPageLog2);
    // Neighbors have different places.
    PageSlot*& slot =
        slots_[static_cast<size_t>(((key[0] & 1) << 2) | ((key[1] & 1) << 1) | (key[2] & 1))];
    if (slot != nullptr) {
      if (slot->key == key) return slot;
      VolumePages::Unpin(slot);
    }
    const PageCell* cell = CellOf(key);
    slot = cell == nullptr ? nullptr : grid_.Pin(*cell);
    if (slot != nullptr) ++pin_count_;
    return slot;
  }
  // The value of a voxel that lies in no leaf.
  float TileValue(Index3 voxel) {
    return grid_.TileValue(voxel, CellOf(Shifted(voxel, kPageLog2)));
  }

 private:
  // The cell of a page; null if it lies in no region.
  const PageCell* CellOf(Index3 page_key) {
    const Index3 key = Shifted(page_key, kRegionLog2 - kPageLog2);
    const PageRegion* region = grid_.Region(region_);
    if (region == nullptr || region->key != key) {
      region_ = grid_.RegionAt(key);
      region = grid_.Region(region_);
    }
    return region == nullptr ? nullptr : &region->cells[CellPlace(page_key)];
  }

  const PagedGrid& grid_;
  std::array<PageSlot*, 8> slots_{};
  uint32_t region_ = PagedGrid::kNoRegion;  // The last one: a look-up costs a hash.
  uint32_t pin_count_ = 0;
};

template <typename BuildT>
class PagedAccessor {
 public:
  using Leaf = nanovdb::NanoLeaf<BuildT>;
  explicit PagedAccessor(PagedPins* pins) : pins_(*pins) {}

  float Background() const { return pins_.grid().background(); }
  // Valid until the next call.
  const Leaf* probeLeaf(const nanovdb::Coord& at) const {
    const PageSlot* slot = pins_.PageOf({at[0], at[1], at[2]});
    if (slot == nullptr) return nullptr;
    const size_t n = BlockPlace({at[0] >> kBlockLog2, at[1] >> kBlockLog2, at[2] >> kBlockLog2});
    const uint32_t offset = reinterpret_cast<const PageHead*>(slot->data)->leaf_offset_bytes[n];
    return offset == 0 ? nullptr : reinterpret_cast<const Leaf*>(slot->data + offset);
  }
  // Requires: the voxel is in no leaf.
  float getValue(const nanovdb::Coord& at) const { return pins_.TileValue({at[0], at[1], at[2]}); }

 private:
  PagedPins& pins_;
};

}  // namespace sheaf::volume
