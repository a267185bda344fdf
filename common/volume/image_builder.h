// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ImageBuilder: builds a NanoVDB image from the nodes of a tree whose number is known: one
// allocation, filled in place, level by level. All grids that do not come from a .nvdb file use it.
#pragma once

#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <utility>

#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/volume/nanovdb_door.h"

namespace sheaf::volume {

struct NodeCounts {
  uint32_t root_tiles = 0;  // Entries of the root's table: upper nodes and values.
  uint64_t upper = 0, lower = 0, leaf = 0;
};

// Writes the metadata of a grid, without its tree.
void FillHead(const std::string& name, const Matrix4& medium_from_index, nanovdb::GridType type,
              uint64_t size_bytes, nanovdb::GridData* head);

template <typename BuildT>
class ImageBuilder {
 public:
  using Root = nanovdb::NanoRoot<BuildT>;
  using Upper = nanovdb::NanoUpper<BuildT>;
  using Lower = nanovdb::NanoLower<BuildT>;
  using Leaf = nanovdb::NanoLeaf<BuildT>;
  using Value = typename Root::ValueType;

  // Errors: kResourceExhausted beyond limits.grid_bytes_max or if memory is short.
  static absl::StatusOr<ImageBuilder> Make(const std::string& where, const std::string& name,
                                           const Matrix4& medium_from_index,
                                           const NodeCounts& counts, Value background,
                                           const VolumeLimits& limits);

  // The next node of its level, all background and inactive.
  // Requires: the counted number is not exceeded.
  Upper* AddUpper(Index3 origin) {
    Upper* node = Next(&upper_, upper_end_);
    Clear(node);
    auto* tile = NextTile();
    tile->setChild(nanovdb::Coord(origin[0], origin[1], origin[2]), node, root_->data());
    return node;
  }
  void AddRootTile(Index3 origin, Value value, bool active) {
    NextTile()->setValue(nanovdb::Coord(origin[0], origin[1], origin[2]), active, value);
  }
  Lower* AddLower(Upper* parent, uint32_t n) {
    Lower* node = Next(&lower_, lower_end_);
    Clear(node);
    SetChild(parent, n, node);
    return node;
  }
  Leaf* AddLeaf(Lower* parent, uint32_t n) {
    Leaf* leaf = Next(&leaf_, leaf_end_);
    SetChild(parent, n, leaf);
    return leaf;  // Zeroed except for its values, all of which the caller must set.
  }
  VolumeBytes TakeImage() && { return std::move(image_); }

 private:
  template <typename Node>
  static Node* Next(Node** at, const Node* end) {
    SHEAF_CHECK(*at < end);
    Node* node = (*at)++;
    std::memset(static_cast<void*>(node), 0, sizeof(Node));
    return node;
  }
  auto* NextTile() {
    SHEAF_CHECK(tile_ < root_->data()->mTableSize);
    return root_->data()->tile(tile_++);
  }
  template <typename Node>
  void Clear(Node* node) {
    for (auto& tile : node->data()->mTable) tile.value = root_->data()->mBackground;
  }
  template <typename Node, typename Child>
  static void SetChild(Node* parent, uint32_t n, Child* child) {
    Words(&parent->data()->mChildMask)[n >> 6] |= uint64_t{1} << (n & 63);
    parent->data()->setChild(n, child);
  }

 public:
  template <typename MaskT>
  static uint64_t* Words(MaskT* mask) {
    return reinterpret_cast<uint64_t*>(mask);
  }

 private:
  VolumeBytes image_;
  Root* root_ = nullptr;
  uint32_t tile_ = 0;
  Upper *upper_ = nullptr, *upper_end_ = nullptr;
  Lower *lower_ = nullptr, *lower_end_ = nullptr;
  Leaf *leaf_ = nullptr, *leaf_end_ = nullptr;
};

template <typename BuildT>
absl::StatusOr<ImageBuilder<BuildT>> ImageBuilder<BuildT>::Make(
    const std::string& where, const std::string& name, const Matrix4& medium_from_index,
    const NodeCounts& counts, Value background, const VolumeLimits& limits) {
  const auto align = [](uint64_t v) {
    return (v + NANOVDB_DATA_ALIGNMENT - 1) / NANOVDB_DATA_ALIGNMENT * NANOVDB_DATA_ALIGNMENT;
  };
  constexpr uint64_t kCountMax = uint64_t{1}
                                 << 40;  // The product with any node's size is below 2^64.
  const uint64_t root_at = sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>);
  const uint64_t upper_at =
      align(root_at + sizeof(Root) + uint64_t{counts.root_tiles} * sizeof(typename Root::Tile));
  const bool countable =
      counts.upper < kCountMax && counts.lower < kCountMax && counts.leaf < kCountMax;
  const uint64_t lower_at = upper_at + (countable ? counts.upper * sizeof(Upper) : 0);
  const uint64_t leaf_at = lower_at + (countable ? counts.lower * sizeof(Lower) : 0);
  const uint64_t size = leaf_at + (countable ? counts.leaf * sizeof(Leaf) : 0);
  if (!countable || size > limits.grid_bytes_max) {
    return absl::ResourceExhaustedError(absl::StrCat(where, ": grid \"", name, "\" takes ", size,
                                                     " bytes, more than ", limits.grid_bytes_max,
                                                     " (grid_bytes_max)"));
  }
  ImageBuilder builder;
  builder.image_ = VolumeBytes(size);
  std::byte* base = builder.image_.data();
  if (base == nullptr) {
    return absl::ResourceExhaustedError(
        absl::StrCat(where, ": no memory for the ", size, " bytes of grid \"", name, "\""));
  }
  std::memset(base, 0, upper_at);
  auto* head = reinterpret_cast<nanovdb::GridData*>(base);
  auto* tree = reinterpret_cast<nanovdb::TreeData<3>*>(head + 1);
  FillHead(name, medium_from_index,
           std::is_same_v<BuildT, float> ? nanovdb::GridType::Float : nanovdb::GridType::Vec3f,
           size, head);
  const uint64_t tree_at = sizeof(nanovdb::GridData);
  const uint64_t offsets[4] = {leaf_at, lower_at, upper_at, root_at};
  const uint64_t node_counts[3] = {counts.leaf, counts.lower, counts.upper};
  for (int level = 0; level < 4; ++level) {
    tree->mNodeOffset[level] = offsets[level] - tree_at;
    if (level < 3) tree->mNodeCount[level] = static_cast<uint32_t>(node_counts[level]);
  }
  builder.root_ = reinterpret_cast<Root*>(base + root_at);
  builder.root_->data()->mTableSize = counts.root_tiles;
  builder.root_->data()->mBackground = background;
  builder.upper_ = reinterpret_cast<Upper*>(base + upper_at);
  builder.upper_end_ = builder.upper_ + counts.upper;
  builder.lower_ = reinterpret_cast<Lower*>(base + lower_at);
  builder.lower_end_ = builder.lower_ + counts.lower;
  builder.leaf_ = reinterpret_cast<Leaf*>(base + leaf_at);
  builder.leaf_end_ = builder.leaf_ + counts.leaf;
  return builder;
}

}  // namespace sheaf::volume
