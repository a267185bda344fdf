// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Volume grids from dense arrays, as scene files contain them.
#pragma once

#include <array>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "common/volume/volume_grid.h"

namespace sheaf {

// An array of nx * ny * nz values over a box of medium space. Shape: [nz][ny][nx]. Value (x, y, z)
// is at ((x + 1/2) / nx, ...) of the box; beyond the outermost values it falls to 0 within one
// voxel, as in pbrt-v4's sampled grids. Blocks of zeros take no memory.
// Errors: kInvalidArgument if sizes and bounds do not form a grid or a value is not finite;
// kResourceExhausted beyond the limits. Messages begin with `where`.
struct VolumeArrayShape {
  std::array<int32_t, 3> size{};  // nx, ny, nz.
  Vec3d lo{0, 0, 0}, hi{1, 1, 1};
};
absl::StatusOr<VolumeGrid> VolumeGridFromArray(const std::string& where, const std::string& name,
                                               const VolumeArrayShape& shape,
                                               std::span<const float> values,
                                               const VolumeLimits& limits = {});
// The same for triples (colors): a grid of vectors.
absl::StatusOr<VolumeGrid> VolumeGridFromArray(const std::string& where, const std::string& name,
                                               const VolumeArrayShape& shape,
                                               std::span<const Vec3f> values,
                                               const VolumeLimits& limits = {});

}  // namespace sheaf
