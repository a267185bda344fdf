// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GridPager: NanoVDB image > pages and their index, one page at a time. The image is untrusted: it
// is read by position, and every offset, size and value is checked on the way.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/volume/grid_facts.h"
#include "common/volume/image_source.h"
#include "common/volume/page_table.h"
#include "common/volume/page_writer.h"

namespace sheaf::volume {

template <typename BuildT>
class GridPager {
  using Root = nanovdb::NanoRoot<BuildT>;
  using Upper = nanovdb::NanoUpper<BuildT>;
  using Lower = nanovdb::NanoLower<BuildT>;
  using Leaf = nanovdb::NanoLeaf<BuildT>;

 public:
  // info: from VerifyHead of the image. All outlive the object.
  GridPager(const std::string& where, const VolumeLimits& limits, VolumeGridInfo* info,
            ImageSource* image, PageWriter* writer)
      : where_(where),
        limits_(limits),
        info_(*info),
        facts_(where, limits, info),
        image_(*image),
        writer_(*writer) {}

  // Writes all pages, and returns the index. Errors: those of VolumeGrid::FromImage, and of
  // writing.
  absl::StatusOr<PageIndex> Run() {
    absl::Status status = WalkRoot();
    if (status.ok()) status = facts_.Finish();
    if (!status.ok()) return status;
    PageIndex index = table_.Finish();
    FillHead(&index.head);
    return index;
  }

 private:
  absl::Status Broken(const std::string& what) const {
    return absl::DataLossError(absl::StrCat(where_, ": grid \"", info_.name,
                                            "\" is damaged: ", what, "; write the file again"));
  }
  template <typename Node>
  bool ReadNode(uint64_t base, int64_t delta, Node* node, uint64_t* offset) {
    int64_t at = 0;
    if (__builtin_add_overflow(static_cast<int64_t>(base), delta, &at) ||
        at < static_cast<int64_t>(sizeof(nanovdb::GridData)) || at % NANOVDB_DATA_ALIGNMENT != 0) {
      return false;
    }
    *offset = static_cast<uint64_t>(at);
    return image_.Read(*offset, sizeof(Node), static_cast<void*>(node));
  }

  absl::Status WalkRoot() {
    nanovdb::GridData grid;
    nanovdb::TreeData<3> tree;
    const uint64_t tree_at = sizeof(grid);
    alignas(64) std::array<std::byte, sizeof(Root)> bytes;
    auto* root = reinterpret_cast<Root*>(bytes.data());
    const auto* data = root->data();
    uint64_t root_at = 0;
    if (!image_.Read(0, sizeof(grid), static_cast<void*>(&grid)) ||
        !image_.Read(tree_at, sizeof(tree), static_cast<void*>(&tree)) ||
        tree.mNodeOffset[3] > image_.size() ||
        !ReadNode(tree_at, static_cast<int64_t>(tree.mNodeOffset[3]), root, &root_at)) {
      return Broken("its root lies outside");
    }
    for (size_t i = 0; i < 9; ++i) matrix_[i] = grid.mMap.mMatD[i];
    for (size_t i = 0; i < 3; ++i) offset_[i] = grid.mMap.mVecD[i];
    if (data->mTableSize > limits_.root_tile_count_max) {
      return absl::ResourceExhaustedError(absl::StrCat(
          where_, ": grid \"", info_.name, "\" has ", data->mTableSize, " tiles at its root, more ",
          "than ", limits_.root_tile_count_max, " (root_tile_count_max); resample it"));
    }
    background_ = data->mBackground;
    table_.SetBackground(background_);
    facts_.seen.Add(background_);
    for (uint32_t i = 0; i < data->mTableSize; ++i) {
      typename Root::Tile tile;
      if (!image_.Read(root_at + sizeof(Root) + i * sizeof(tile), sizeof(tile),
                       static_cast<void*>(&tile))) {
        return Broken("the root's table does not fit");
      }
      const absl::Status status = WalkTile(tile, root_at);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  template <typename Tile>
  absl::Status WalkTile(const Tile& tile, uint64_t root_at) {
    const nanovdb::Coord at = tile.origin();
    const Index3 origin{at[0], at[1], at[2]};
    if (Root::DataType::CoordToKey(at) != tile.key || !table_.AddRoot(Shifted(origin, kRootLog2))) {
      return Broken("two tiles at the same place, or none");
    }
    if (tile.isChild()) return WalkUpper(root_at, tile.child, origin);
    table_.SetRootValue(Shifted(origin, kRootLog2), tile.value);
    return facts_.AddTile(origin, Upper::TOTAL, tile.value, tile.state != 0);
  }

  absl::Status WalkUpper(uint64_t base, int64_t delta, Index3 origin) {
    const VolumeBytes bytes(sizeof(Upper));
    auto* upper = reinterpret_cast<Upper*>(bytes.data());
    uint64_t at = 0;
    if (upper == nullptr || !ReadNode(base, delta, upper, &at)) {
      return Broken("an upper node lies outside");
    }
    if (++upper_count_ > image_.size() / sizeof(Upper)) return Broken("upper nodes are shared");
    const auto& data = *upper->data();
    for (uint32_t n = 0; n < Upper::SIZE; ++n) {
      const Index3 child = ChildOrigin(origin, n, Upper::LOG2DIM, Lower::TOTAL);
      absl::Status status;
      if (data.mChildMask.isOn(n)) {
        status = WalkLower(at, data.mTable[n].child, child);
      } else {
        const float value = data.mTable[n].value;
        if (value != background_) table_.AddRegion(Shifted(child, kRegionLog2), value);
        status = facts_.AddTile(child, Lower::TOTAL, value, data.mValueMask.isOn(n));
      }
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  absl::Status WalkLower(uint64_t base, int64_t delta, Index3 origin) {
    const VolumeBytes bytes(sizeof(Lower));
    auto* lower = reinterpret_cast<Lower*>(bytes.data());
    uint64_t at = 0;
    if (lower == nullptr || !ReadNode(base, delta, lower, &at)) {
      return Broken("a lower node lies outside");
    }
    if (++lower_count_ > image_.size() / sizeof(Lower)) return Broken("lower nodes are shared");
    for (const int32_t o : origin) {
      if (std::abs(int64_t{o}) > limits_.index_abs_max) {
        return Broken("a node lies beyond the limit of coordinates (index_abs_max)");
      }
    }
    table_.AddRegion(Shifted(origin, kRegionLog2), background_);
    const Index3 first = Shifted(origin, kPageLog2);
    for (int32_t p = 0; p < static_cast<int32_t>(kCells); ++p) {
      const absl::Status status = WalkPage(
          *lower, at, {first[0] + (p >> 6), first[1] + ((p >> 3) & 7), first[2] + (p & 7)});
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  absl::Status WalkPage(const Lower& lower, uint64_t lower_at, Index3 key) {
    const auto& data = *lower.data();
    std::array<float, kBlocks> tiles{};
    uint32_t mask = 0;
    leaves_.clear();
    for (uint32_t b = 0; b < kBlocks; ++b) {
      const Index3 block{2 * key[0] + static_cast<int32_t>(b >> 2),
                         2 * key[1] + static_cast<int32_t>((b >> 1) & 1),
                         2 * key[2] + static_cast<int32_t>(b & 1)};
      const auto n =
          static_cast<uint32_t>(((block[0] & 15) << 8) | ((block[1] & 15) << 4) | (block[2] & 15));
      absl::Status status;
      if (data.mChildMask.isOn(n)) {
        mask |= 1u << b;
        status = AddLeaf(lower_at, data.mTable[n].child, block);
      } else {
        tiles[b] = data.mTable[n].value;
        status = facts_.AddTile({block[0] << 3, block[1] << 3, block[2] << 3}, Leaf::TOTAL,
                                tiles[b], data.mValueMask.isOn(n));
      }
      if (!status.ok()) return status;
    }
    PageEntry* entry = nullptr;
    table_.SetPage(key, tiles, mask, &entry);
    if (mask == 0) return absl::OkStatus();
    return writer_.AddPage(leaves_, std::is_same_v<BuildT, float> ? sizeof(float) : 1, entry);
  }

  absl::Status AddLeaf(uint64_t base, int64_t delta, Index3 block) {
    alignas(64) std::array<std::byte, kLeafBytesMax> bytes;
    auto* leaf = reinterpret_cast<Leaf*>(bytes.data());
    uint64_t at = 0;
    if (!ReadNode(base, delta, leaf, &at)) return Broken("a leaf lies outside");
    if constexpr (std::is_same_v<BuildT, nanovdb::FpN>) {
      if ((leaf->data()->mFlags >> 5) > 4) return Broken("a leaf has codes of unknown width");
    }
    const uint64_t size = LeafBytes<BuildT>(*leaf);
    if (!image_.Read(at, size, bytes.data())) return Broken("a leaf does not fit");
    if (++leaf_count_ > image_.size() / sizeof(Leaf)) return Broken("leaves are shared");
    const size_t begin = leaves_.size();
    leaves_.resize(begin + (size + NANOVDB_DATA_ALIGNMENT - 1) / NANOVDB_DATA_ALIGNMENT *
                               NANOVDB_DATA_ALIGNMENT);
    std::memcpy(leaves_.data() + begin, bytes.data(), size);
    std::array<float, Leaf::SIZE> values;
    for (uint32_t n = 0; n < Leaf::SIZE; ++n) values[n] = leaf->data()->getValue(n);
    for (const float value : values) facts_.seen.AddNumber(value);
    table_.AddLeaf(block, values);
    return facts_.AddLeafBounds(leaf->data()->mValueMask,
                                {block[0] << 3, block[1] << 3, block[2] << 3});
  }

  void FillHead(PageGridHead* head) const {
    head->name.fill(0);
    std::copy_n(info_.name.begin(), std::min(info_.name.size(), head->name.size() - 1),
                head->name.begin());
    std::copy_n(matrix_, 9, head->matrix);
    std::copy_n(offset_, 3, head->offset);
    head->image_bytes = image_.size();
    head->active_voxel_count = info_.active_voxel_count;
    head->index_min = info_.index_min;
    head->index_max = info_.index_max;
    head->values = info_.values;
    head->type = static_cast<uint32_t>(info_.type);
  }

  // The largest leaf takes 2,144 bytes.
  static constexpr size_t kLeafBytesMax = 4096;
  static_assert(sizeof(Leaf) <= kLeafBytesMax);

  const std::string& where_;
  const VolumeLimits& limits_;
  VolumeGridInfo& info_;
  GridFacts facts_;
  ImageSource& image_;
  PageWriter& writer_;
  PageTable table_;
  std::vector<std::byte> leaves_;  // The page that the walk is in.
  double matrix_[9] = {}, offset_[3] = {};
  float background_ = 0;
  uint64_t upper_count_ = 0, lower_count_ = 0, leaf_count_ = 0;
};

}  // namespace sheaf::volume
