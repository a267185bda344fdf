// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The surface on which a grid of a .vdb file has a value, as a mesh: of a level set, its zero; of a
// density, any value. OpenVDB's mesher makes it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"
#include "common/volume/volume_grid.h"

namespace sheaf {

struct VolumeSurface {
  std::vector<Vec3d> positions;     // Medium space.
  std::vector<Vec3f> normals;       // One per position: unit vectors out of the body.
  std::vector<uint32_t> triangles;  // Three positions each, counterclockwise seen from outside.

  uint64_t SizeBytes() const {
    return positions.size() * (sizeof(Vec3d) + sizeof(Vec3f)) + triangles.size() * sizeof(uint32_t);
  }
};

// grid_name: empty for the only grid of the file. isovalue: the body has smaller values in level
// sets and larger ones in other grids. limits.grid_bytes_max bounds the surface, too.
// Errors: as ReadVolumeGrid; also kInvalidArgument for .nvdb files and for grids of vectors.
absl::StatusOr<VolumeSurface> ReadVolumeSurface(const std::string& file_name,
                                                const std::string& local_path,
                                                const std::string& grid_name, float isovalue,
                                                const VolumeLimits& limits = {});

}  // namespace sheaf
