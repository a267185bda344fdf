// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/nanovdb_verify.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/mutex.h"
#include "common/base/parallel.h"
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

// The range of the values seen; joining ranges in any order gives the same result.
struct Seen {
  float min = std::numeric_limits<float>::infinity();
  float max = -std::numeric_limits<float>::infinity();
  bool finite = true;

  void AddNumber(float v) {
    min = std::min(min, v);
    max = std::max(max, v);
    finite &= std::fabs(v) <= std::numeric_limits<float>::max();  // False for NaN.
  }
  template <typename ValueT>
  void Add(const ValueT& v) {
    AddNumber(Magnitude(v));
  }
  void Join(const Seen& other) {
    min = std::min(min, other.min);
    max = std::max(max, other.max);
    finite &= other.finite;
  }
};

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
      : image_(image), where_(where), limits_(limits), info_(*info) {}

  absl::Status Run(int thread_count) {
    const absl::Status nodes = WalkRoot();
    if (!nodes.ok()) return nodes;
    WalkLeaves(thread_count);
    return Finish();
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

  absl::Status AddActive(Index3 origin, int32_t size) {
    for (size_t a = 0; a < 3; ++a) {
      const int64_t last = int64_t{origin[a]} + size - 1;
      if (origin[a] < -limits_.index_abs_max || last > limits_.index_abs_max) {
        return absl::InvalidArgumentError(absl::StrCat(
            where_, ": grid \"", info_.name, "\" holds voxels at index ", last,
            ", beyond the limit of +-", limits_.index_abs_max, " (index_abs_max); resample it"));
      }
      info_.index_min[a] = std::min(info_.index_min[a], origin[a]);
      info_.index_max[a] = std::max(info_.index_max[a], static_cast<int32_t>(last));
    }
    return absl::OkStatus();
  }
  template <typename ValueT>
  absl::Status AddTile(Index3 origin, uint32_t log2_size, const ValueT& value, bool active) {
    seen_.Add(value);
    if (!active) return absl::OkStatus();
    info_.active_voxel_count += uint64_t{1} << (3 * log2_size);
    return AddActive(origin, 1 << log2_size);
  }

  absl::Status WalkRoot() {
    info_.index_min.fill(std::numeric_limits<int32_t>::max());
    info_.index_max.fill(std::numeric_limits<int32_t>::min());
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
    seen_.Add(data.mBackground);
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
      const absl::Status status = tile.isChild()
                                      ? WalkUpper(NodeAt<Upper>(root, tile.child), at)
                                      : AddTile(at, Upper::TOTAL, tile.value, tile.state != 0);
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
              : AddTile(at, Lower::TOTAL, data.mTable[n].value, data.mValueMask.isOn(n));
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
            AddTile(at, Leaf::TOTAL, data.mTable[n].value, data.mValueMask.isOn(n));
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
      const absl::Status status = AddLeafBounds(leaf->data()->mValueMask, at);
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  }

  template <typename MaskT>
  absl::Status AddLeafBounds(const MaskT& mask, Index3 origin) {
    // Bit n is voxel (n >> 6, (n >> 3) & 7, n & 7): word x holds the bits of y and z.
    uint64_t any_x = 0;
    uint32_t x_bits = 0;
    uint64_t words[8];
    static_assert(sizeof(mask) == sizeof(words));
    std::memcpy(words, &mask, sizeof(words));
    for (uint32_t x = 0; x < 8; ++x) {
      info_.active_voxel_count += static_cast<uint64_t>(std::popcount(words[x]));
      any_x |= words[x];
      x_bits |= static_cast<uint32_t>(words[x] != 0) << x;
    }
    if (any_x == 0) return absl::OkStatus();
    uint32_t y_bits = 0, z_bits = 0;
    for (uint32_t y = 0; y < 8; ++y) {
      const auto row = static_cast<uint32_t>((any_x >> (8 * y)) & 0xff);
      y_bits |= static_cast<uint32_t>(row != 0) << y;
      z_bits |= row;
    }
    const uint32_t bits[3] = {x_bits, y_bits, z_bits};
    Index3 lo = origin, hi = origin;
    for (size_t a = 0; a < 3; ++a) {
      lo[a] += std::countr_zero(bits[a]);
      hi[a] += std::bit_width(bits[a]) - 1;
    }
    const absl::Status low = AddActive(lo, 1);
    return low.ok() ? AddActive(hi, 1) : low;
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
    seen_.Join(joined.seen);
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

  absl::Status Finish() {
    if (!seen_.finite) {
      return absl::InvalidArgumentError(
          absl::StrCat(where_, ": grid \"", info_.name,
                       "\" holds NaN or infinity; set such voxels to 0 when writing it"));
    }
    if (info_.active_voxel_count == 0) {
      info_.index_min = {0, 0, 0};
      info_.index_max = {-1, -1, -1};
    }
    info_.values = {seen_.min, seen_.max};
    return absl::OkStatus();
  }

  const VolumeBytes& image_;
  const std::string& where_;
  const VolumeLimits& limits_;
  VolumeGridInfo& info_;
  Seen seen_;
  uint64_t upper_count_ = 0, lower_count_ = 0;
  std::vector<LeafPlace> leaves_;
};

}  // namespace

absl::StatusOr<VolumeGridInfo> VerifyHead(const VolumeBytes& image, const std::string& where,
                                          const VolumeLimits& limits) {
  if (image.size() < sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>)) {
    return absl::DataLossError(
        absl::StrCat(where, ": a grid of ", image.size(), " bytes is cut short"));
  }
  const auto& data = *reinterpret_cast<const nanovdb::GridData*>(image.data());
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
  if (image.size() > limits.grid_bytes_max) {
    return absl::ResourceExhaustedError(absl::StrCat(where, ": grid \"", info.name, "\" takes ",
                                                     image.size(), " bytes, more than ",
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
  info.memory_bytes = image.size();
  return info;
}

absl::Status VerifyNodes(const VolumeBytes& image, const std::string& where,
                         const VolumeLimits& limits, int thread_count, VolumeGridInfo* info) {
  return WithType(info->type, [&]<typename BuildT>() {
    return Verifier<BuildT>(image, where, limits, info).Run(thread_count);
  });
}

}  // namespace sheaf::volume
