// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_grid.h"

#include <algorithm>
#include <cmath>
#include <new>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/volume/nanovdb_door.h"
#include "common/volume/nanovdb_verify.h"

namespace sheaf {
namespace {

// Beyond these an index has no voxel and, as a double, would not fit an int32.
constexpr double kIndexAbsMax = 0x1p30;

template <typename BuildT>
using Accessor = nanovdb::ReadAccessor<BuildT, 0, 1, 2>;

// a at w = 0, b as w approaches 1, and never beyond either: with w <= 1 - 2^-24 the rounded
// difference times w stays within the exact one, and rounding is monotone.
float Lerp(float w, float a, float b) { return std::fma(w, b - a, a); }
nanovdb::Vec3f Lerp(float w, const nanovdb::Vec3f& a, const nanovdb::Vec3f& b) {
  return {Lerp(w, a[0], b[0]), Lerp(w, a[1], b[1]), Lerp(w, a[2], b[2])};
}

struct Split {
  nanovdb::Coord voxel;
  float w[3];  // In [0, 1 - 2^-24].
};
// False if p is beyond all voxels or not finite.
bool SplitPoint(Vec3d p, Split* split) {
  for (size_t a = 0; a < 3; ++a) {
    if (!(std::fabs(p[a]) < kIndexAbsMax)) return false;
    const double whole = std::floor(p[a]);
    split->voxel[static_cast<int>(a)] = static_cast<int32_t>(whole);
    split->w[a] = std::min(static_cast<float>(p[a] - whole), 0x1.fffffep-1f);
  }
  return true;
}

constexpr uint32_t kLeafMask = 7;  // Bits of a coordinate within a leaf.

template <typename ValueT>
ValueT Trilinear(const ValueT (&v)[8], const float (&w)[3]) {
  return Lerp(w[0], Lerp(w[1], Lerp(w[2], v[0], v[1]), Lerp(w[2], v[2], v[3])),
              Lerp(w[1], Lerp(w[2], v[4], v[5]), Lerp(w[2], v[6], v[7])));
}

// Reads the voxels ijk + (c >> 2, c >> 1 & 1, c & 1), c < 8, which lie in several leaves or tiles;
// looks up each of these once.
template <typename BuildT, typename ValueT>
void ReadAcrossLeaves(const Accessor<BuildT>& accessor, nanovdb::Coord ijk, ValueT (&v)[8]) {
  const auto local = [&](int axis, uint32_t step) {
    return (static_cast<uint32_t>(ijk[axis]) + step) & kLeafMask;
  };
  uint32_t crossing = 0;  // The axes on which a step enters the next leaf.
  for (int axis = 0; axis < 3; ++axis) {
    crossing |= static_cast<uint32_t>(local(axis, 0) == kLeafMask) << (2 - axis);
  }
  const uint32_t within = ~crossing & 7;
  // Subsets of both masks, the full one first.
  for (uint32_t first = crossing;; first = (first - 1) & crossing) {
    const nanovdb::Coord at = ijk + nanovdb::Coord(static_cast<int32_t>(first >> 2),
                                                   static_cast<int32_t>((first >> 1) & 1),
                                                   static_cast<int32_t>(first & 1));
    const auto* leaf = accessor.probeLeaf(at);
    for (uint32_t step = within;; step = (step - 1) & within) {
      const uint32_t c = first | step;
      v[c] = leaf == nullptr
                 ? ValueT(accessor.getValue(at))
                 : ValueT(leaf->data()->getValue((local(0, c >> 2) << 6) |
                                                 (local(1, (c >> 1) & 1) << 3) | local(2, c & 1)));
      if (step == 0) break;
    }
    if (first == 0) break;
  }
}

// Source: the order of interpolation (z, y, x) is that of NanoVDB's trilinear sampler.
template <typename BuildT>
auto Sample(const Accessor<BuildT>& accessor, Vec3d p) {
  using ValueT = typename nanovdb::NanoRoot<BuildT>::ValueType;
  Split split;
  if (!SplitPoint(p, &split)) return ValueT(accessor.root().background());
  const nanovdb::Coord ijk = split.voxel;
  ValueT v[8];
  const bool inside = (ijk[0] & kLeafMask) != kLeafMask && (ijk[1] & kLeafMask) != kLeafMask &&
                      (ijk[2] & kLeafMask) != kLeafMask;
  if (inside) {
    // All eight voxels lie in the same leaf or tile.
    const auto* leaf = accessor.probeLeaf(ijk);
    if (leaf == nullptr) return ValueT(accessor.getValue(ijk));
    const auto& data = *leaf->data();
    const auto n = static_cast<uint32_t>(((ijk[0] & kLeafMask) << 6) | ((ijk[1] & kLeafMask) << 3) |
                                         (ijk[2] & kLeafMask));
    for (uint32_t c = 0; c < 8; ++c) {
      v[c] = data.getValue(n + ((c >> 2) << 6) + (((c >> 1) & 1) << 3) + (c & 1));
    }
  } else {
    ReadAcrossLeaves(accessor, ijk, v);
  }
  return Trilinear(v, split.w);
}

template <typename BuildT>
const Accessor<BuildT>& AccessorOf(const std::byte* bytes) {
  return *std::launder(reinterpret_cast<const Accessor<BuildT>*>(bytes));
}

Matrix4 MatrixOf(const nanovdb::Map& map) {
  Matrix4 m;
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 3; ++column) m.m[row][column] = map.mMatD[3 * row + column];
    m.m[row][3] = map.mVecD[row];
  }
  return m;
}

bool Contains(const std::string& text, std::initializer_list<const char*> words) {
  for (const char* word : words) {
    if (absl::StrContains(text, word)) return true;
  }
  return false;
}

// The common value of all voxels of [lo, hi] if the tree has one; see VolumeGrid::UniformValue.
template <typename BuildT>
class UniformSearch {
  using ValueT = typename nanovdb::NanoRoot<BuildT>::ValueType;
  using Root = nanovdb::NanoRoot<BuildT>;
  using Upper = nanovdb::NanoUpper<BuildT>;
  using Lower = nanovdb::NanoLower<BuildT>;

 public:
  UniformSearch(const Root& root, Index3 lo, Index3 hi) : root_(root), lo_(lo), hi_(hi) {}

  std::optional<ValueT> Run() {
    uint64_t covered = 0;
    for (uint32_t i = 0; i < root_.data()->mTableSize; ++i) {
      const auto& tile = *root_.data()->tile(i);
      const nanovdb::Coord at = tile.origin();
      const Index3 origin{at[0], at[1], at[2]};
      Index3 from, to;
      if (!Overlap(origin, Upper::TOTAL, &from, &to)) continue;
      covered += (uint64_t(to[0] - from[0]) + 1) * (uint64_t(to[1] - from[1]) + 1) *
                 (uint64_t(to[2] - from[2]) + 1);
      if (tile.isChild() ? !InNode(*root_.data()->getChild(&tile), origin)
                         : !IncludeValue(tile.value)) {
        return std::nullopt;
      }
    }
    const uint64_t all = (uint64_t(hi_[0] - lo_[0]) + 1) * (uint64_t(hi_[1] - lo_[1]) + 1) *
                         (uint64_t(hi_[2] - lo_[2]) + 1);
    if (covered != all && !IncludeValue(root_.data()->mBackground)) return std::nullopt;
    return value_;
  }

 private:
  bool IncludeValue(const ValueT& value) {
    if (!value_) value_ = value;
    return *value_ == value;
  }
  // The part of the box in a node with sides of 2^log2 voxels.
  bool Overlap(Index3 origin, uint32_t log2, Index3* from, Index3* to) const {
    for (size_t a = 0; a < 3; ++a) {
      (*from)[a] = std::max(lo_[a], origin[a]);
      (*to)[a] = static_cast<int32_t>(
          std::min<int64_t>(hi_[a], int64_t{origin[a]} + (int64_t{1} << log2) - 1));
      if ((*from)[a] > (*to)[a]) return false;
    }
    return true;
  }
  template <typename Node>
  bool InNode(const Node& node, Index3 origin) {
    constexpr uint32_t kChild = Node::TOTAL - Node::LOG2DIM;
    Index3 from, to;
    if (!Overlap(origin, Node::TOTAL, &from, &to)) return true;
    for (size_t a = 0; a < 3; ++a) {
      from[a] = (from[a] - origin[a]) >> kChild;
      to[a] = (to[a] - origin[a]) >> kChild;
    }
    for (int32_t x = from[0]; x <= to[0]; ++x) {
      for (int32_t y = from[1]; y <= to[1]; ++y) {
        for (int32_t z = from[2]; z <= to[2]; ++z) {
          const auto n = static_cast<uint32_t>((((x << Node::LOG2DIM) | y) << Node::LOG2DIM) | z);
          if (!node.data()->mChildMask.isOn(n)) {
            if (!IncludeValue(node.data()->mTable[n].value)) return false;
          } else if constexpr (Node::LEVEL == 1) {
            return false;
          } else if (!InNode(*node.data()->getChild(n),
                             volume::ChildOrigin(origin, n, Node::LOG2DIM, kChild))) {
            return false;
          }
        }
      }
    }
    return true;
  }

  const Root& root_;
  Index3 lo_, hi_;
  std::optional<ValueT> value_;
};

// See VolumeGrid::ReadBox.
template <typename BuildT, typename Out>
void ReadVoxels(const Accessor<BuildT>& accessor, Index3 lo, Index3 hi, const Out& out) {
  size_t at = 0;
  for (int32_t x = lo[0]; x <= hi[0]; ++x) {
    for (int32_t y = lo[1]; y <= hi[1]; ++y) {
      for (int32_t z = lo[2]; z <= hi[2];) {
        // To the end of the leaf or tile.
        const int32_t last = std::min(hi[2], z | 7);
        const auto* leaf = accessor.probeLeaf({x, y, z});
        if (leaf == nullptr) {
          const auto value = accessor.getValue({x, y, z});
          for (; z <= last; ++z) out(at++, value);
          continue;
        }
        const auto& data = *leaf->data();
        const auto row = static_cast<uint32_t>(((x & 7) << 6) | ((y & 7) << 3));
        for (; z <= last; ++z) out(at++, data.getValue(row | static_cast<uint32_t>(z & 7)));
      }
    }
  }
}

}  // namespace

VolumeRole VolumeRoleOf(const std::string& grid_name) {
  const std::string name = absl::AsciiStrToLower(grid_name);
  // Source: the names used by OpenVDB's own tools, Houdini and EmberGen.
  if (Contains(name, {"temperature", "heat"}) || name == "temp") return VolumeRole::kTemperature;
  if (Contains(name, {"velocity"}) || name == "vel" || name == "v") return VolumeRole::kVelocity;
  if (Contains(name, {"flame", "emission", "fire"}) || name == "le") return VolumeRole::kEmission;
  if (Contains(name, {"density", "smoke", "fog"}) || name.empty()) return VolumeRole::kDensity;
  return VolumeRole::kOther;
}

VolumeGrid::Cursor::Cursor(const VolumeGrid& grid) {
  volume::WithType(grid.info_.type, [&]<typename BuildT>() {
    static_assert(sizeof(Accessor<BuildT>) <= sizeof(accessor_) && alignof(Accessor<BuildT>) <= 8 &&
                  std::is_trivially_destructible_v<Accessor<BuildT>>);
    new (accessor_.data()) Accessor<BuildT>(volume::RootOf<BuildT>(*grid.image_));
  });
}

absl::StatusOr<VolumeGrid> VolumeGrid::FromImage(VolumeBytes image, const std::string& where,
                                                 const VolumeLimits& limits, int thread_count) {
  auto info = volume::VerifyHead(image, where, limits);
  if (!info.ok()) return info.status();
  const auto& head = *reinterpret_cast<const nanovdb::GridData*>(image.data());
  VolumeGrid grid;
  grid.medium_from_index_ = MatrixOf(head.mMap);
  if (!Invert(grid.medium_from_index_, &grid.index_from_medium_)) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, ": grid \"", info->name, "\" has a transform that is singular or not finite"));
  }
  const absl::Status nodes = volume::VerifyNodes(image, where, limits, thread_count, &*info);
  if (!nodes.ok()) return nodes;
  grid.info_ = *std::move(info);
  grid.image_ = std::make_shared<const VolumeBytes>(std::move(image));
  for (size_t a = 0; a < 3; ++a) {
    grid.box_.lo[a] = grid.info_.index_min[a];
    grid.box_.hi[a] = grid.info_.index_max[a] + (grid.info_.active_voxel_count > 0 ? 1 : 0);
  }
  return grid;
}

float VolumeGrid::At(Vec3d p_index, Cursor* cursor) const {
  return volume::WithScalarType(info_.type, [&]<typename BuildT>() {
    return Sample(AccessorOf<BuildT>(cursor->accessor_.data()), p_index);
  });
}

Vec3f VolumeGrid::VectorAt(Vec3d p_index, Cursor* cursor) const {
  SHEAF_CHECK(is_vector());
  const nanovdb::Vec3f v = Sample(AccessorOf<nanovdb::Vec3f>(cursor->accessor_.data()), p_index);
  return {v[0], v[1], v[2]};
}

absl::Status VolumeGrid::CheckDensity(const std::string& where) const {
  if (is_vector()) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, ": grid \"", info_.name, "\" holds vectors; a density is a grid of scalars"));
  }
  if (info_.values.min < 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, ": grid \"", info_.name, "\" holds negative densities, down to ", info_.values.min,
        "; convert a level set to a fog volume, and clamp resampled densities at 0"));
  }
  return absl::OkStatus();
}

void VolumeGrid::ReadBox(Index3 lo, Index3 hi, std::span<float> out, Cursor* cursor) const {
  volume::WithScalarType(info_.type, [&]<typename BuildT>() {
    ReadVoxels<BuildT>(AccessorOf<BuildT>(cursor->accessor_.data()), lo, hi,
                       [out](size_t i, float value) { out[i] = value; });
  });
}

void VolumeGrid::ReadComponentBox(size_t component, Index3 lo, Index3 hi, std::span<float> out,
                                  Cursor* cursor) const {
  SHEAF_CHECK(is_vector());
  ReadVoxels<nanovdb::Vec3f>(
      AccessorOf<nanovdb::Vec3f>(cursor->accessor_.data()), lo, hi,
      [&](size_t i, const nanovdb::Vec3f& value) { out[i] = value[static_cast<int>(component)]; });
}

std::optional<float> VolumeGrid::UniformValue(Index3 lo, Index3 hi) const {
  return volume::WithScalarType(info_.type, [&]<typename BuildT>() {
    return UniformSearch<BuildT>(volume::RootOf<BuildT>(*image_), lo, hi).Run();
  });
}

std::optional<Vec3f> VolumeGrid::UniformVector(Index3 lo, Index3 hi) const {
  SHEAF_CHECK(is_vector());
  using BuildT = nanovdb::Vec3f;
  const auto v = UniformSearch<BuildT>(volume::RootOf<BuildT>(*image_), lo, hi).Run();
  return v ? std::optional<Vec3f>({(*v)[0], (*v)[1], (*v)[2]}) : std::nullopt;
}

}  // namespace sheaf
