// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/nanovdb_verify.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/mutex.h"
#include "common/base/parallel.h"
#include "common/volume/grid_facts.h"
#include "common/volume/nanovdb_door.h"

namespace sheaf::volume {
namespace {

constexpr uint64_t kNodeAlignment = NANOVDB_DATA_ALIGNMENT;
constexpr uint64_t kLeavesPerRange = 4096;
constexpr uint32_t kMajorVersion = NANOVDB_MAJOR_VERSION_NUMBER;

std::optional<VolumeValueType> TypeOf(nanovdb::GridType type) {
  switch (type) {
    case nanovdb::GridType::Float:
      return VolumeValueType::kFloat;
    case nanovdb::GridType::Fp4:
      return VolumeValueType::kFp4;
    case nanovdb::GridType::Fp8:
      return VolumeValueType::kFp8;
    case nanovdb::GridType::Fp16:
      return VolumeValueType::kFp16;
    case nanovdb::GridType::FpN:
      return VolumeValueType::kFpN;
    case nanovdb::GridType::Vec3f:
      return VolumeValueType::kVec3f;
    default:
      return std::nullopt;
  }
}

struct LeafPlace {
  uint64_t offset_bytes;
  Index3 origin;
};

template <typename BuildT>
class Verifier {
  using Root = nanovdb::NanoRoot<BuildT>;
  using Upper = nanovdb::NanoUpper<BuildT>;
  using Lower = nanovdb::NanoLower<BuildT>;
  using Leaf = nanovdb::NanoLeaf<BuildT>;

 public:
  Verifier(const VolumeBytes& image, const std::string& where, const VolumeLimits& limits,
           VolumeGridInfo* info)
      : image_(image), where_(where), limits_(limits), info_(*info), facts_(where, limits, info) {}

  absl::Status Run(int thread_count) {
    const absl::Status nodes = WalkRoot();
    if (!nodes.ok()) return nodes;
    WalkLeaves(thread_count);
    return facts_.Finish();
  }

 private:
  absl::Status Broken(const std::string& what) const {
    return absl::DataLossError(absl::StrCat(where_, ": grid \"", info_.name,
                                            "\" is damaged: ", what, "; write the file again"));
  }
  uint64_t OffsetOf(const void* node) const {
    return static_cast<uint64_t>(static_cast<const std::byte*>(node) - image_.data());
  }
  // The node at `delta_bytes` from `base`; null if it is not aligned or not inside the image.
  template <typename Node>
  const Node* NodeAt(const void* base, int64_t delta_bytes) const {
    int64_t offset = 0;
    if (__builtin_add_overflow(static_cast<int64_t>(OffsetOf(base)), delta_bytes, &offset) ||
        offset < static_cast<int64_t>(sizeof(nanovdb::GridData)) ||
        static_cast<uint64_t>(offset) % kNodeAlignment != 0 ||
        static_cast<uint64_t>(offset) > image_.size() ||
        image_.size() - static_cast<uint64_t>(offset) < sizeof(Node)) {
      return nullptr;
    }
    return reinterpret_cast<const Node*>(image_.data() + offset);
  }

  absl::Status WalkRoot() {
    const auto* tree = NodeAt<nanovdb::TreeData<3>>(image_.data(), sizeof(nanovdb::GridData));
    if (tree == nullptr) return Broken("no tree");
    if (tree->mNodeOffset[3] > image_.size()) return Broken("its root lies outside");
    const auto* root = NodeAt<Root>(tree, static_cast<int64_t>(tree->mNodeOffset[3]));
    if (root == nullptr) return Broken("its root lies outside");
    const auto& data = *root->data();
    using Tile = typename Root::Tile;
    if (data.mTableSize > limits_.root_tile_count_max) {
      return absl::ResourceExhaustedError(
          absl::StrCat(where_, ": grid \"", info_.name, "\" has ", data.mTableSize,
                       " tiles at its root, more than ", limits_.root_tile_count_max,
                       " (root_tile_count_max); resample it"));
    }
    if ((image_.size() - OffsetOf(root) - sizeof(Root)) / sizeof(Tile) < data.mTableSize) {
      return Broken("the root's table does not fit");
    }
    facts_.seen.Add(data.mBackground);
    info_.background = Magnitude(data.mBackground);
    std::vector<uint64_t> keys;
    for (uint32_t i = 0; i < data.mTableSize; ++i) {
      const Tile& tile = *data.tile(i);
      const nanovdb::Coord origin = tile.origin();
      if (std::remove_cvref_t<decltype(data)>::CoordToKey(origin) != tile.key) {
        return Broken("a tile's key is not a position");
      }
      keys.push_back(tile.key);
      const Index3 at{origin[0], origin[1], origin[2]};
      const absl::Status status =
          tile.isChild() ? WalkUpper(NodeAt<Upper>(root, tile.child), at)
                         : facts_.AddTile(at, Upper::TOTAL, tile.value, tile.state != 0);
      if (!status.ok()) return status;
    }
    std::sort(keys.begin(), keys.end());
    if (std::adjacent_find(keys.begin(), keys.end()) != keys.end()) {
      return Broken("two tiles at the same place");
    }
    return absl::OkStatus();
  }

  absl::Status WalkUpper(const Upper* node, Index3 origin) {
    if (node == nullptr) return Broken("an upper node lies outside");
    if (++upper_count_ > image_.size() / sizeof(Upper)) return Broken("upper nodes are shared");
    const auto& data = *node->data();
    for (uint32_t n = 0; n < Upper::SIZE; ++n) {
      const Index3 at = ChildOrigin(origin, n, Upper::LOG2DIM, Lower::TOTAL);
      const absl::Status status =
          data.mChildMask.isOn(n)
              ? WalkLower(NodeAt<Lower>(node, data.mTable[n].child), at)
              : facts_.AddTile(at, Lower::TOTAL, data.mTable[n].value, data.mValueMask.isOn(n));
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  absl::Status WalkLower(const Lower* node, Index3 origin) {
    if (node == nullptr) return Broken("a lower node lies outside");
    if (++lower_count_ > image_.size() / sizeof(Lower)) return Broken("lower nodes are shared");
    const auto& data = *node->data();
    for (uint32_t n = 0; n < Lower::SIZE; ++n) {
      const Index3 at = ChildOrigin(origin, n, Lower::LOG2DIM, Leaf::TOTAL);
      if (!data.mChildMask.isOn(n)) {
        const absl::Status status =
            facts_.AddTile(at, Leaf::TOTAL, data.mTable[n].value, data.mValueMask.isOn(n));
        if (!status.ok()) return status;
        continue;
      }
      const auto* leaf = NodeAt<Leaf>(node, data.mTable[n].child);
      if (leaf == nullptr) return Broken("a leaf lies outside");
      if constexpr (std::is_same_v<BuildT, nanovdb::FpN>) {
        // Lookups support codes of 1 to 16 bits.
        if ((leaf->data()->mFlags >> 5) > 4) return Broken("a leaf has codes of unknown width");
      }
      if (image_.size() - OffsetOf(leaf) < LeafBytes<BuildT>(*leaf)) {
        return Broken("a leaf does not fit");
      }
      if (leaves_.size() >= image_.size() / sizeof(Leaf)) return Broken("leaves are shared");
      leaves_.push_back({OffsetOf(leaf), at});
      const absl::Status status = facts_.AddLeafBounds(leaf->data()->mValueMask, at);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  void WalkLeaves(int thread_count) {
    struct Joined {
      Mutex mutex;
      Seen seen ABSL_GUARDED_BY(mutex);
    };
    Joined joined;
    ParallelRanges(leaves_.size(), kLeavesPerRange, thread_count,
                   [&](uint64_t begin, uint64_t end) {
                     Seen seen;
                     for (uint64_t i = begin; i < end; ++i)
                       AddLeafValues(leaves_[i].offset_bytes, &seen);
                     const MutexLock lock(&joined.mutex);
                     joined.seen.Join(seen);
                   });
    const MutexLock lock(&joined.mutex);
    facts_.seen.Join(joined.seen);
  }
  void AddLeafValues(uint64_t offset_bytes, Seen* seen) const {
    const auto& leaf = *reinterpret_cast<const Leaf*>(image_.data() + offset_bytes);
    // Separate lanes, so that the loop is vectorized.
    constexpr uint32_t kLanes = 16;
    Seen lanes[kLanes];
    for (uint32_t n = 0; n < Leaf::SIZE; n += kLanes) {
      for (uint32_t lane = 0; lane < kLanes; ++lane) {
        lanes[lane].Add(leaf.data()->getValue(n + lane));
      }
    }
    for (const Seen& lane : lanes) seen->Join(lane);
  }

  const VolumeBytes& image_;
  const std::string& where_;
  const VolumeLimits& limits_;
  VolumeGridInfo& info_;
  GridFacts facts_;
  uint64_t upper_count_ = 0, lower_count_ = 0;
  std::vector<LeafPlace> leaves_;
};

}  // namespace

absl::StatusOr<VolumeGridInfo> VerifyHead(std::span<const std::byte> head, uint64_t image_bytes,
                                          const std::string& where, const VolumeLimits& limits) {
  constexpr size_t kLeast = sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>);
  if (image_bytes < kLeast || head.size() < kLeast) {
    return absl::DataLossError(
        absl::StrCat(where, ": a grid of ", image_bytes, " bytes is cut short"));
  }
  const auto& data = *reinterpret_cast<const nanovdb::GridData*>(head.data());
  VolumeGridInfo info;
  const size_t name_size = ::strnlen(data.mGridName, sizeof(data.mGridName));
  info.name.assign(data.mGridName, name_size);
  if (data.mMagic != NANOVDB_MAGIC_NUMBER) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": a grid does not begin as NanoVDB"));
  }
  if (data.mVersion.getMajor() != kMajorVersion) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, ": grid \"", info.name, "\" is of NanoVDB version ", data.mVersion.getMajor(),
        ", only ", kMajorVersion, " can be read; convert it with that version's nanovdb_convert"));
  }
  if (image_bytes > limits.grid_bytes_max) {
    return absl::ResourceExhaustedError(absl::StrCat(where, ": grid \"", info.name, "\" takes ",
                                                     image_bytes, " bytes, more than ",
                                                     limits.grid_bytes_max, " (grid_bytes_max)"));
  }
  const auto type = TypeOf(data.mGridType);
  if (!type) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, ": grid \"", info.name, "\" holds values of type ",
        data.mGridType < nanovdb::GridType::End ? nanovdb::toStr(data.mGridType) : "unknown",
        "; grids of float, Float4, Float8, Float16, FloatN and Vec3f can be read: convert it"));
  }
  info.type = *type;
  info.role = VolumeRoleOf(info.name);
  info.memory_bytes = image_bytes;
  return info;
}

absl::Status VerifyNodes(const VolumeBytes& image, const std::string& where,
                         const VolumeLimits& limits, int thread_count, VolumeGridInfo* info) {
  return WithType(info->type, [&]<typename BuildT>() {
    return Verifier<BuildT>(image, where, limits, info).Run(thread_count);
  });
}

}  // namespace sheaf::volume
