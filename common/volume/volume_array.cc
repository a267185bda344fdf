// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_array.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/volume/image_builder.h"

namespace sheaf {
namespace {

nanovdb::Vec3f Stored(Vec3f v) { return {v.x, v.y, v.z}; }
float Stored(float v) { return v; }
bool IsZero(Vec3f v) { return v == Vec3f{}; }
bool IsZero(float v) { return v == 0; }

template <typename T>
class ArrayTree {
  using BuildT = std::conditional_t<std::is_same_v<T, float>, float, nanovdb::Vec3f>;
  using Builder = volume::ImageBuilder<BuildT>;

 public:
  ArrayTree(const VolumeArrayShape& shape, std::span<const T> values)
      : size_(shape.size), values_(values) {}

  volume::NodeCounts Count() const {
    volume::NodeCounts counts;
    const auto leaf = [&](auto, uint32_t, Index3 at) {
      counts.leaf += IsEmpty(at, 8) ? 0 : 1;
      return 0;
    };
    const auto lower = [&](auto, uint32_t, Index3 at) {
      if (IsEmpty(at, 128)) return;
      ++counts.lower;
      ForEachChild(at, 128, 8, 0, leaf);
    };
    ForEachRoot([&](Index3 at) {
      if (IsEmpty(at, 4096)) return;
      ++counts.upper;
      ForEachChild(at, 4096, 128, 0, lower);
    });
    counts.root_tiles = static_cast<uint32_t>(counts.upper);
    return counts;
  }

  void Build(Builder* builder) const {
    const auto leaf = [&](auto* parent, uint32_t n, Index3 at) {
      if (!IsEmpty(at, 8)) FillLeaf(builder->AddLeaf(parent, n), at);
    };
    const auto lower = [&](auto* parent, uint32_t n, Index3 at) {
      if (!IsEmpty(at, 128)) ForEachChild(at, 128, 8, builder->AddLower(parent, n), leaf);
    };
    ForEachRoot([&](Index3 at) {
      if (!IsEmpty(at, 4096)) ForEachChild(at, 4096, 128, builder->AddUpper(at), lower);
    });
  }

 private:
  const T& At(int32_t x, int32_t y, int32_t z) const {
    return values_[(static_cast<size_t>(z) * static_cast<size_t>(size_[1]) +
                    static_cast<size_t>(y)) *
                       static_cast<size_t>(size_[0]) +
                   static_cast<size_t>(x)];
  }
  Index3 EndOf(Index3 at, int32_t side) const {
    for (size_t a = 0; a < 3; ++a) at[a] = std::min(size_[a], at[a] + side);
    return at;
  }
  bool IsEmpty(Index3 at, int32_t side) const {
    const Index3 end = EndOf(at, side);
    for (int32_t z = at[2]; z < end[2]; ++z) {
      for (int32_t y = at[1]; y < end[1]; ++y) {
        for (int32_t x = at[0]; x < end[0]; ++x) {
          if (!IsZero(At(x, y, z))) return false;
        }
      }
    }
    return true;
  }
  template <typename Function>
  void ForEachRoot(const Function& function) const {
    for (int32_t x = 0; x < size_[0]; x += 4096) {
      for (int32_t y = 0; y < size_[1]; y += 4096) {
        for (int32_t z = 0; z < size_[2]; z += 4096) function(Index3{x, y, z});
      }
    }
  }
  template <typename Parent, typename Function>
  void ForEachChild(Index3 at, int32_t side, int32_t child, Parent parent,
                    const Function& function) const {
    const Index3 end = EndOf(at, side);
    const int32_t count = side / child;
    for (int32_t x = at[0]; x < end[0]; x += child) {
      for (int32_t y = at[1]; y < end[1]; y += child) {
        for (int32_t z = at[2]; z < end[2]; z += child) {
          const int32_t n =
              ((x - at[0]) / child * count + (y - at[1]) / child) * count + (z - at[2]) / child;
          function(parent, static_cast<uint32_t>(n), Index3{x, y, z});
        }
      }
    }
  }
  void FillLeaf(typename Builder::Leaf* leaf, Index3 at) const {
    auto& data = *leaf->data();
    uint64_t* words = Builder::Words(&data.mValueMask);
    const Index3 end = EndOf(at, 8);
    for (int32_t x = at[0]; x < end[0]; ++x) {
      for (int32_t y = at[1]; y < end[1]; ++y) {
        for (int32_t z = at[2]; z < end[2]; ++z) {
          const auto n =
              static_cast<uint32_t>(((x - at[0]) << 6) | ((y - at[1]) << 3) | (z - at[2]));
          data.mValues[n] = Stored(At(x, y, z));
          words[n >> 6] |= uint64_t{1} << (n & 63);
        }
      }
    }
  }

  Index3 size_;
  std::span<const T> values_;
};

template <typename T>
absl::StatusOr<VolumeGrid> FromArray(const std::string& where, const std::string& name,
                                     const VolumeArrayShape& shape, std::span<const T> values,
                                     const VolumeLimits& limits) {
  const auto bad = [&](const std::string& what) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": grid \"", name, "\": ", what));
  };
  Matrix4 medium_from_index;
  for (size_t a = 0; a < 3; ++a) {
    const int32_t n = shape.size[a];
    if (n < 1 || n > limits.index_abs_max) {
      return bad(absl::StrCat("nx, ny and nz must lie in [1, ", limits.index_abs_max,
                              "] (index_abs_max), one is ", n));
    }
    const double voxel = (shape.hi[a] - shape.lo[a]) / n;
    if (!(voxel > 0) || !std::isfinite(voxel)) {
      return bad("its box is empty: p0 must be less than p1 on every axis");
    }
    medium_from_index.m[a][a] = voxel;
    medium_from_index.m[a][3] = shape.lo[a] + 0.5 * voxel;
  }
  uint64_t count = 0;
  if (__builtin_mul_overflow(static_cast<uint64_t>(shape.size[0]), shape.size[1], &count) ||
      __builtin_mul_overflow(count, static_cast<uint64_t>(shape.size[2]), &count) ||
      count != values.size()) {
    return bad(absl::StrCat("nx * ny * nz = ", shape.size[0], " * ", shape.size[1], " * ",
                            shape.size[2], " values are expected, but there are ", values.size()));
  }
  const ArrayTree<T> tree(shape, values);
  using BuildT = std::conditional_t<std::is_same_v<T, float>, float, nanovdb::Vec3f>;
  auto builder = volume::ImageBuilder<BuildT>::Make(where, name, medium_from_index, tree.Count(),
                                                    Stored(T{}), limits);
  if (!builder.ok()) return builder.status();
  tree.Build(&*builder);
  auto grid = VolumeGrid::FromImage((*std::move(builder)).TakeImage(), where, limits);
  if (!grid.ok()) return grid;
  IndexBox box;
  for (size_t a = 0; a < 3; ++a) {
    box.lo[a] = -0.5;
    box.hi[a] = shape.size[a] - 0.5;
  }
  grid->set_box(box);
  return grid;
}

}  // namespace

absl::StatusOr<VolumeGrid> VolumeGridFromArray(const std::string& where, const std::string& name,
                                               const VolumeArrayShape& shape,
                                               std::span<const float> values,
                                               const VolumeLimits& limits) {
  return FromArray(where, name, shape, values, limits);
}
absl::StatusOr<VolumeGrid> VolumeGridFromArray(const std::string& where, const std::string& name,
                                               const VolumeArrayShape& shape,
                                               std::span<const Vec3f> values,
                                               const VolumeLimits& limits) {
  return FromArray(where, name, shape, values, limits);
}

}  // namespace sheaf
