// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lookups in a grid by an accessor: NanoVDB's, of a grid in memory, or PagedAccessor. Both give the
// same leaves, so that lookups give the same bits.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "common/math/vec.h"
#include "common/volume/nanovdb_door.h"

namespace sheaf::volume {

template <typename Accessor>
auto BackgroundOf(const Accessor& accessor) {
  if constexpr (requires { accessor.Background(); }) {
    return accessor.Background();
  } else {
    return accessor.root().background();
  }
}

// Beyond these an index has no voxel and, as a double, would not fit an int32.
inline constexpr double kIndexAbsMax = 0x1p30;

// a at w = 0, b as w approaches 1, and never beyond either: with w <= 1 - 2^-24 the rounded
// difference times w stays within the exact one, and rounding is monotone.
inline float Lerp(float w, float a, float b) { return std::fma(w, b - a, a); }
inline nanovdb::Vec3f Lerp(float w, const nanovdb::Vec3f& a, const nanovdb::Vec3f& b) {
  return {Lerp(w, a[0], b[0]), Lerp(w, a[1], b[1]), Lerp(w, a[2], b[2])};
}

struct Split {
  nanovdb::Coord voxel;
  float w[3];  // In [0, 1 - 2^-24].
};
// False if p is beyond all voxels or not finite.
inline bool SplitPoint(Vec3d p, Split* split) {
  for (size_t a = 0; a < 3; ++a) {
    if (!(std::fabs(p[a]) < kIndexAbsMax)) return false;
    const double whole = std::floor(p[a]);
    split->voxel[static_cast<int>(a)] = static_cast<int32_t>(whole);
    split->w[a] = std::min(static_cast<float>(p[a] - whole), 0x1.fffffep-1f);
  }
  return true;
}

inline constexpr uint32_t kLeafMask = 7;  // Bits of a coordinate within a leaf.

template <typename ValueT>
ValueT Trilinear(const ValueT (&v)[8], const float (&w)[3]) {
  return Lerp(w[0], Lerp(w[1], Lerp(w[2], v[0], v[1]), Lerp(w[2], v[2], v[3])),
              Lerp(w[1], Lerp(w[2], v[4], v[5]), Lerp(w[2], v[6], v[7])));
}

// Reads the voxels ijk + (c >> 2, c >> 1 & 1, c & 1), c < 8, which lie in several leaves or tiles;
// looks up each of these once.
template <typename Accessor, typename ValueT>
void ReadAcrossLeaves(const Accessor& accessor, nanovdb::Coord ijk, ValueT (&v)[8]) {
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
template <typename ValueT, typename Accessor>
ValueT Sample(const Accessor& accessor, Vec3d p) {
  Split split;
  if (!SplitPoint(p, &split)) return BackgroundOf(accessor);
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

// See VolumeGrid::ReadBox.
template <typename Accessor, typename Out>
void ReadVoxels(const Accessor& accessor, Index3 lo, Index3 hi, const Out& out) {
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

}  // namespace sheaf::volume
