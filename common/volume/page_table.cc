// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/page_table.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

namespace sheaf::volume {
namespace {

// Parts of a leaf along an axis: the voxels that the block below reaches, all, and those that the
// block above reaches.
struct Part {
  int first, count;
};
constexpr Part kParts[3] = {{0, 3}, {0, 8}, {7, 1}};

ValueRange Union(const ValueRange* at, size_t stride, Part part) {
  ValueRange range = at[static_cast<size_t>(part.first) * stride];
  for (int i = 1; i < part.count; ++i) {
    const ValueRange& next = at[static_cast<size_t>(part.first + i) * stride];
    range = {std::min(range.min, next.min), std::max(range.max, next.max)};
  }
  return range;
}

}  // namespace

void PageTable::AddLeaf(Index3 block, std::span<const float, 512> v) {
  // Axis by axis, the last first.
  std::array<ValueRange, 64 * 3> z;
  for (size_t row = 0; row < 64; ++row) {
    for (size_t c = 0; c < 3; ++c) {
      const float* at = &v[row * 8 + static_cast<size_t>(kParts[c].first)];
      const auto [low, high] = std::minmax_element(at, at + kParts[c].count);
      z[row * 3 + c] = {*low, *high};
    }
  }
  std::array<ValueRange, 8 * 9> y;
  for (size_t x = 0; x < 8; ++x) {
    for (size_t c = 0; c < 9; ++c) {
      y[x * 9 + c] = Union(&z[x * 24 + c % 3], 3, kParts[c / 3]);
    }
  }
  for (size_t c = 0; c < 27; ++c) {
    const Index3 to{block[0] + static_cast<int32_t>(c / 9) - 1,
                    block[1] + static_cast<int32_t>(c / 3 % 3) - 1,
                    block[2] + static_cast<int32_t>(c % 3) - 1};
    Widen(to, Union(&y[c % 9], 9, kParts[c / 9]));
  }
}

void PageTable::Widen(Index3 block, ValueRange range) {
  const Index3 key = Shifted(block, kPageLog2 - kBlockLog2);
  if (last_place_ >= index_.entries.size() || index_.entries[last_place_].key != key) {
    last_place_ = EntryAt(key);
  }
  ValueRange& reach = index_.entries[last_place_].reach[BlockPlace(block)];
  reach = {std::min(reach.min, range.min), std::max(reach.max, range.max)};
}

uint32_t PageTable::EntryAt(Index3 key) {
  const auto [at, is_new] = entry_of_.emplace(key, index_.entries.size());
  if (is_new) {
    PageEntry& entry = index_.entries.emplace_back();
    std::memset(static_cast<void*>(&entry), 0, sizeof(entry));
    entry.key = key;
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    entry.reach.fill({kInfinity, -kInfinity});
    has_tiles_.push_back(false);
  }
  return at->second;
}

uint32_t PageTable::RegionAt(Index3 key, float value) {
  const auto [at, is_new] = region_of_.emplace(key, index_.regions.size());
  if (is_new) {
    PageRegion& region = index_.regions.emplace_back();
    region.key = key;
    region.mean_rest = 0;
    region.cells.fill({value, 0});
  }
  return at->second;
}

float PageTable::ValueOfPage(Index3 key) const {
  const auto region = region_of_.find(Shifted(key, kRegionLog2 - kPageLog2));
  if (region != region_of_.end()) {
    return index_.regions[region->second].cells[CellPlace(key)].value;
  }
  const auto root = root_values_.find(Shifted(key, kRootLog2 - kPageLog2));
  return root == root_values_.end() ? background_ : root->second.value_or(background_);
}

std::optional<float> PageTable::TileOf(Index3 block) const {
  const Index3 key = Shifted(block, kPageLog2 - kBlockLog2);
  const auto entry = entry_of_.find(key);
  if (entry == entry_of_.end()) return ValueOfPage(key);
  const PageEntry& page = index_.entries[entry->second];
  const size_t n = BlockPlace(block);
  return (page.mask >> n & 1) != 0 ? std::nullopt : std::optional<float>(page.tiles[n]);
}

void PageTable::FillTiles() {
  for (size_t i = 0; i < index_.entries.size(); ++i) {
    if (!has_tiles_[i]) index_.entries[i].tiles.fill(ValueOfPage(index_.entries[i].key));
  }
}

void PageTable::FillRanges() {
  for (PageEntry& entry : index_.entries) {
    // The blocks of the page, and those around.
    std::array<std::optional<float>, 4 * 4 * 4> tiles;
    for (int32_t i = 0; i < 4 * 4 * 4; ++i) {
      tiles[static_cast<size_t>(i)] =
          TileOf({2 * entry.key[0] + i / 16 - 1, 2 * entry.key[1] + i / 4 % 4 - 1,
                  2 * entry.key[2] + i % 4 - 1});
    }
    for (size_t n = 0; n < kBlocks; ++n) {
      ValueRange& reach = entry.reach[n];
      const size_t corner = (n >> 2) * 16 + ((n >> 1) & 1) * 4 + (n & 1);
      for (size_t c = 0; c < 27; ++c) {
        const auto& tile = tiles[corner + c / 9 * 16 + c / 3 % 3 * 4 + c % 3];
        if (tile) reach = {std::min(reach.min, *tile), std::max(reach.max, *tile)};
      }
    }
  }
}

void PageTable::LinkPages() {
  for (uint32_t i = 0; i < index_.entries.size(); ++i) {
    const Index3 key = index_.entries[i].key;
    const uint32_t region = RegionAt(Shifted(key, kRegionLog2 - kPageLog2), ValueOfPage(key));
    index_.regions[region].cells[CellPlace(key)].page = i + 1;
  }
  for (const auto& [key, value] : root_values_) {
    if (value) index_.root_tiles.push_back({key, *value});
  }
  const auto by_key = [](const auto& a, const auto& b) { return a.key < b.key; };
  std::sort(index_.root_tiles.begin(), index_.root_tiles.end(), by_key);
  std::sort(index_.regions.begin(), index_.regions.end(), by_key);
}

void PageTable::SetRootValue(Index3 key, float value) { root_values_[key] = value; }

void PageTable::SetPage(Index3 key, const std::array<float, kBlocks>& tiles, uint32_t mask,
                        PageEntry** entry) {
  *entry = nullptr;
  const bool is_uniform =
      mask == 0 && std::all_of(tiles.begin(), tiles.end(), [&](float v) { return v == tiles[0]; });
  if (is_uniform && !entry_of_.contains(key)) {
    const uint32_t region = RegionAt(Shifted(key, kRegionLog2 - kPageLog2), background_);
    index_.regions[region].cells[CellPlace(key)].value = tiles[0];
    return;
  }
  const uint32_t place = EntryAt(key);
  has_tiles_[place] = true;
  *entry = &index_.entries[place];
  (*entry)->tiles = tiles;
  (*entry)->mask = mask;
}

PageIndex PageTable::Finish() {
  FillTiles();
  FillRanges();
  LinkPages();
  index_.head.background = background_;
  index_.head.root_tile_count = static_cast<uint32_t>(index_.root_tiles.size());
  index_.head.region_count = static_cast<uint32_t>(index_.regions.size());
  index_.head.page_count = static_cast<uint32_t>(index_.entries.size());
  return std::move(index_);
}

}  // namespace sheaf::volume
