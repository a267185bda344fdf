// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the targets of volume files share: reading all grids of a file within small limits, and
// looking up values of those that are accepted.
#pragma once

#include <cmath>
#include <cstdint>
#include <string_view>
#include <vector>

#include "common/volume/volume_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf::testing {

inline constexpr VolumeLimits kVolumeLimits{
    .grid_bytes_max = uint64_t{1} << 26, .grid_count_max = 8, .root_tile_count_max = 1 << 10};

inline void LookUp(const VolumeGrid& grid) {
  const auto& info = grid.info();
  VolumeGrid::Cursor cursor(grid);
  uint64_t state = 1;
  for (int i = 0; i < 200; ++i) {
    Vec3d p;
    for (size_t a = 0; a < 3; ++a) {
      state = state * 6364136223846793005u + 1442695040888963407u;
      const double u = static_cast<double>(state >> 33) * 0x1p-31;
      const double lo = grid.box().lo[a] - 9, hi = grid.box().hi[a] + 9;
      // Near the lower end, where most values are, and everywhere.
      p[a] = i % 2 == 0 ? lo + u * 32 : lo + u * (hi - lo);
    }
    if (grid.is_vector()) {
      const Vec3f v = grid.VectorAt(p, &cursor);
      SHEAF_CHECK(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z));
      continue;
    }
    const float v = grid.At(p, &cursor);
    SHEAF_CHECK(v >= info.values.min && v <= info.values.max);
    const Index3 at{static_cast<int32_t>(p.x), static_cast<int32_t>(p.y),
                    static_cast<int32_t>(p.z)};
    const Index3 to{at[0] + 9, at[1] + 9, at[2] + 9};
    std::vector<float> box(1000);
    grid.ReadBox(at, to, box, &cursor);
    const auto uniform = grid.UniformValue(at, to);
    for (const float value : box) SHEAF_CHECK(!uniform || value == *uniform);
  }
}

// Whether the bytes begin as those of a .vdb file.
inline bool BeginsAsVdb(std::string_view bytes) {
  return bytes.starts_with(std::string_view(" BDV\0\0\0\0", 8));
}

inline void ReadAllGrids(std::string_view bytes) {
  const MemoryFile file(bytes);
  const auto entries = ListVolumeFile("a", file.Path(), kVolumeLimits);
  if (!entries.ok()) return;
  for (const VolumeFileEntry& entry : *entries) {
    const auto grid = ReadVolumeGrid("a", file.Path(), entry.name, kVolumeLimits);
    if (grid.ok()) LookUp(*grid);
  }
}

}  // namespace sheaf::testing
