// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What tests of volume files share: values of voxels, and a fixture that reads bytes as a file.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "common/base/file.h"
#include "common/volume/volume_file.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_writers.h"

namespace sheaf::testing {

inline float Ramp(const Voxel& v) {
  return static_cast<float>((v[0] + 40) + 100 * (v[1] + 40)) +
         0.25f * static_cast<float>(v[2] + 40);
}
inline float Lumps(const Voxel& v) {
  const int64_t x = v[0], y = v[1], z = v[2];  // Voxels lie as far away as int32_t reaches.
  return static_cast<float>((x * 7 + y * 13 + z * 5) & 15) / 16;
}

class VolumeFileTest : public ::testing::Test {
 protected:
  ~VolumeFileTest() override { ::unlink(path_.c_str()); }
  absl::StatusOr<VolumeGrid> Read(const std::string& bytes, const std::string& grid = "density",
                                  const VolumeLimits& limits = {}) {
    EXPECT_TRUE(WriteFileAtomically(path_, bytes).ok());
    return ReadVolumeGrid("smoke.vdb", path_, grid, limits);
  }
  std::string Message(const std::string& bytes, const std::string& grid = "density",
                      const VolumeLimits& limits = {}) {
    const auto read = Read(bytes, grid, limits);
    EXPECT_FALSE(read.ok());
    return read.ok() ? "" : std::string(read.status().message());
  }
  const std::string path_ = TemporaryPath("volume");
};

// Compares every voxel, and one beyond the edge, with the written values.
inline void ExpectVoxels(const VolumeGrid& grid, const GridToWrite& written, float tolerance) {
  VolumeGrid::Cursor cursor(grid);
  for (int32_t x = written.lo[0] - 1; x <= written.hi[0] + 1; ++x) {
    for (int32_t y = written.lo[1] - 1; y <= written.hi[1] + 1; ++y) {
      for (int32_t z = written.lo[2] - 1; z <= written.hi[2] + 1; ++z) {
        const bool inside = x >= written.lo[0] && x <= written.hi[0] && y >= written.lo[1] &&
                            y <= written.hi[1] && z >= written.lo[2] && z <= written.hi[2];
        const float expected = inside ? written.value({x, y, z}) : written.background;
        ASSERT_NEAR(grid.At({double(x), double(y), double(z)}, &cursor), expected, tolerance)
            << x << " " << y << " " << z;
      }
    }
  }
}

}  // namespace sheaf::testing
