// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_grid.h"

#include <algorithm>
#include <memory>
#include <new>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/volume/grid_lookup.h"
#include "common/volume/nanovdb_door.h"
#include "common/volume/nanovdb_verify.h"
#include "common/volume/paged_accessor.h"

namespace sheaf {
namespace {

template <typename BuildT>
using Accessor = nanovdb::ReadAccessor<BuildT, 0, 1, 2>;

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

VolumeGrid::Cursor::Cursor(const VolumeGrid& grid) : is_paged_(grid.pages_ != nullptr) {
  if (is_paged_) {
    static_assert(sizeof(volume::PagedPins) <= sizeof(accessor_));
    new (accessor_.data()) volume::PagedPins(*grid.pages_);
    return;
  }
  volume::WithType(grid.info_.type, [&]<typename BuildT>() {
    static_assert(sizeof(Accessor<BuildT>) <= sizeof(accessor_) && alignof(Accessor<BuildT>) <= 8 &&
                  std::is_trivially_destructible_v<Accessor<BuildT>>);
    new (accessor_.data()) Accessor<BuildT>(volume::RootOf<BuildT>(*grid.image_));
  });
}

volume::PagedPins* VolumeGrid::Cursor::pins() {
  return std::launder(reinterpret_cast<volume::PagedPins*>(accessor_.data()));
}

void VolumeGrid::Cursor::Unpin() { std::destroy_at(pins()); }

absl::StatusOr<VolumeGrid> VolumeGrid::FromPages(std::shared_ptr<const volume::PagedGrid> pages,
                                                 const std::string& where) {
  VolumeGrid grid;
  grid.info_ = pages->Info();
  grid.medium_from_index_ = pages->MediumFromIndex();
  grid.pages_ = std::move(pages);
  const absl::Status placed = grid.Place(where);
  if (!placed.ok()) return placed;
  return grid;
}

absl::Status VolumeGrid::Place(const std::string& where) {
  if (!Invert(medium_from_index_, &index_from_medium_)) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, ": grid \"", info_.name, "\" has a transform that is singular or not finite"));
  }
  for (size_t a = 0; a < 3; ++a) {
    box_.lo[a] = info_.index_min[a];
    box_.hi[a] = info_.index_max[a] + (info_.active_voxel_count > 0 ? 1 : 0);
  }
  return absl::OkStatus();
}

uint64_t VolumeGrid::memory_bytes() const {
  const auto owners = pages_ != nullptr ? pages_.use_count() : image_.use_count();
  return info_.memory_bytes / static_cast<uint64_t>(owners);
}

void VolumeGrid::AddOtherBytes(uint64_t bytes) const {
  if (pages_ != nullptr) pages_->pages().AddOtherBytes(bytes);
}

std::optional<ValueRange> VolumeGrid::BlockRange(Index3 origin) const {
  return pages_ == nullptr ? std::nullopt : pages_->BlockRange(origin);
}

double VolumeGrid::MeanValue() const {
  if (pages_ != nullptr && pages_->mean() != 0) return pages_->mean();
  constexpr int kPlacesAcross = 16;
  const Vec3d size = box_.hi - box_.lo;
  if (!(size.x > 0 && size.y > 0 && size.z > 0)) return 0;
  const auto at = [&](size_t axis, int i) {
    return box_.lo[axis] + (i + 0.5) / kPlacesAcross * size[axis];
  };
  Cursor cursor(*this);
  double sum = 0;
  for (int x = 0; x < kPlacesAcross; ++x) {
    for (int y = 0; y < kPlacesAcross; ++y) {
      for (int z = 0; z < kPlacesAcross; ++z) {
        sum += static_cast<double>(At({at(0, x), at(1, y), at(2, z)}, &cursor));
      }
    }
  }
  // A page file has room for two floats.
  const double mean = sum / (kPlacesAcross * kPlacesAcross * kPlacesAcross);
  const auto rounded = static_cast<float>(mean);
  return double{rounded} + double{static_cast<float>(mean - double{rounded})};
}

float VolumeGrid::PagedAt(Vec3d p_index, Cursor* cursor) const {
  return volume::WithScalarType(info_.type, [&]<typename BuildT>() {
    return volume::Sample<float>(volume::PagedAccessor<BuildT>(cursor->pins()), p_index);
  });
}

absl::StatusOr<VolumeGrid> VolumeGrid::FromImage(VolumeBytes image, const std::string& where,
                                                 const VolumeLimits& limits, int thread_count) {
  auto info = volume::VerifyHead({image.data(), image.size()}, image.size(), where, limits);
  if (!info.ok()) return info.status();
  const auto& head = *reinterpret_cast<const nanovdb::GridData*>(image.data());
  VolumeGrid grid;
  grid.medium_from_index_ = MatrixOf(head.mMap);
  const absl::Status nodes = volume::VerifyNodes(image, where, limits, thread_count, &*info);
  if (!nodes.ok()) return nodes;
  grid.info_ = *std::move(info);
  grid.image_ = std::make_shared<const VolumeBytes>(std::move(image));
  const absl::Status placed = grid.Place(where);
  if (!placed.ok()) return placed;
  return grid;
}

float VolumeGrid::At(Vec3d p_index, Cursor* cursor) const {
  if (pages_ != nullptr) return PagedAt(p_index, cursor);
  return volume::WithScalarType(info_.type, [&]<typename BuildT>() {
    return volume::Sample<float>(AccessorOf<BuildT>(cursor->accessor_.data()), p_index);
  });
}

Vec3f VolumeGrid::VectorAt(Vec3d p_index, Cursor* cursor) const {
  SHEAF_CHECK(is_vector());
  const auto v =
      volume::Sample<nanovdb::Vec3f>(AccessorOf<nanovdb::Vec3f>(cursor->accessor_.data()), p_index);
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
  const auto write = [out](size_t i, float value) { out[i] = value; };
  if (pages_ != nullptr) {
    volume::WithScalarType(info_.type, [&]<typename BuildT>() {
      volume::ReadVoxels(volume::PagedAccessor<BuildT>(cursor->pins()), lo, hi, write);
    });
    return;
  }
  volume::WithScalarType(info_.type, [&]<typename BuildT>() {
    volume::ReadVoxels(AccessorOf<BuildT>(cursor->accessor_.data()), lo, hi, write);
  });
}

void VolumeGrid::ReadComponentBox(size_t component, Index3 lo, Index3 hi, std::span<float> out,
                                  Cursor* cursor) const {
  SHEAF_CHECK(is_vector());
  volume::ReadVoxels(
      AccessorOf<nanovdb::Vec3f>(cursor->accessor_.data()), lo, hi,
      [&](size_t i, const nanovdb::Vec3f& value) { out[i] = value[static_cast<int>(component)]; });
}

std::optional<float> VolumeGrid::UniformValue(Index3 lo, Index3 hi) const {
  if (pages_ != nullptr) return pages_->UniformValue(lo, hi);
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
