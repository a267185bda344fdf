// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Feeds arbitrary bytes to the readers of volume files, .nvdb and .vdb, and looks up values of
// accepted grids. Memory is bounded by the limits below.
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/volume/volume_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace sheaf {
namespace {

constexpr VolumeLimits kLimits{
    .grid_bytes_max = uint64_t{1} << 26, .grid_count_max = 8, .root_tile_count_max = 1 << 10};

void LookUp(const VolumeGrid& grid) {
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

}  // namespace

SHEAF_FUZZ_TARGET(volume) {
  const testing::MemoryFile file(bytes);
  const auto entries = ListVolumeFile("a", file.Path(), kLimits);
  if (!entries.ok()) return;
  for (const VolumeFileEntry& entry : *entries) {
    const auto grid = ReadVolumeGrid("a", file.Path(), entry.name, kLimits);
    if (grid.ok()) LookUp(*grid);
  }
}

}  // namespace sheaf
