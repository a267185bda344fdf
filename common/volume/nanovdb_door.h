// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The only header that includes NanoVDB: its node types, and shared helpers of this folder for
// walking them. NanoVDB types are not visible outside this folder.
#pragma once

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpragmas"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wundef"
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wunknown-warning-option"
#include <nanovdb/NanoVDB.h>
#pragma GCC diagnostic pop

#include <cstdint>

#include "common/volume/volume_grid.h"

namespace sheaf::volume {

// Calls function.operator()<BuildT>() with the build type of a grid of scalars.
template <typename Function>
auto WithScalarType(VolumeValueType type, const Function& function) {
  switch (type) {
    case VolumeValueType::kFp4:
      return function.template operator()<nanovdb::Fp4>();
    case VolumeValueType::kFp8:
      return function.template operator()<nanovdb::Fp8>();
    case VolumeValueType::kFp16:
      return function.template operator()<nanovdb::Fp16>();
    case VolumeValueType::kFpN:
      return function.template operator()<nanovdb::FpN>();
    default:
      return function.template operator()<float>();
  }
}
// The same, including vectors.
template <typename Function>
auto WithType(VolumeValueType type, const Function& function) {
  if (type == VolumeValueType::kVec3f) return function.template operator()<nanovdb::Vec3f>();
  return WithScalarType(type, function);
}

template <typename BuildT>
const nanovdb::NanoRoot<BuildT>& RootOf(const VolumeBytes& image) {
  return reinterpret_cast<const nanovdb::NanoGrid<BuildT>*>(image.data())->tree().root();
}

// The size of a leaf in bytes. Requires: its fixed head lies in the image.
template <typename BuildT>
uint64_t LeafBytes(const nanovdb::NanoLeaf<BuildT>& leaf) {
  if constexpr (std::is_same_v<BuildT, nanovdb::FpN>) {
    return leaf.data()->memUsage();
  } else {
    return sizeof(nanovdb::NanoLeaf<BuildT>);
  }
}

// The origin of child n of an internal node with 2^log2_side children per side.
inline Index3 ChildOrigin(Index3 origin, uint32_t n, uint32_t log2_side, uint32_t log2_child) {
  const uint32_t mask = (1u << log2_side) - 1;
  return {origin[0] + static_cast<int32_t>((n >> (2 * log2_side)) << log2_child),
          origin[1] + static_cast<int32_t>(((n >> log2_side) & mask) << log2_child),
          origin[2] + static_cast<int32_t>((n & mask) << log2_child)};
}

// Calls function(n) for each set bit n of a NanoVDB mask, skipping empty words.
template <typename MaskT, typename Function>
void ForEachOn(const MaskT& mask, const Function& function) {
  for (auto it = mask.beginOn(); it; ++it) function(*it);
}

// The number whose range is recorded: the length of a vector.
inline float Magnitude(float v) { return v; }
inline float Magnitude(const nanovdb::Vec3f& v) {
  return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

}  // namespace sheaf::volume
