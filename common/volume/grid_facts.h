// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GridFacts: the properties of a grid that only a walk through all of its tiles and leaves tells:
// the bounds and the number of active voxels, and the range of values.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "common/volume/nanovdb_door.h"

namespace sheaf::volume {

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

class GridFacts {
 public:
  // Completes *info. where: messages begin with it. All outlive the object.
  GridFacts(const std::string& where, const VolumeLimits& limits, VolumeGridInfo* info)
      : where_(where), limits_(limits), info_(*info) {
    info_.index_min.fill(std::numeric_limits<int32_t>::max());
    info_.index_max.fill(std::numeric_limits<int32_t>::min());
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
    seen.Add(value);
    if (!active) return absl::OkStatus();
    info_.active_voxel_count += uint64_t{1} << (3 * log2_size);
    return AddActive(origin, 1 << log2_size);
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

  // The values of leaves are added to `seen` directly.
  absl::Status Finish() {
    if (!seen.finite) {
      return absl::InvalidArgumentError(
          absl::StrCat(where_, ": grid \"", info_.name,
                       "\" holds NaN or infinity; set such voxels to 0 when writing it"));
    }
    if (info_.active_voxel_count == 0) {
      info_.index_min = {0, 0, 0};
      info_.index_max = {-1, -1, -1};
    }
    info_.values = {seen.min, seen.max};
    return absl::OkStatus();
  }

  Seen seen;

 private:
  const std::string& where_;
  const VolumeLimits& limits_;
  VolumeGridInfo& info_;
};

}  // namespace sheaf::volume
