// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VolumeExtents: where the grids are that media read from files, for people who have the file from
// others and place a shape around it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/volume/volume_file.h"

namespace sheaf::cli {

// Larger files are left out, unless they are page files, of which only the index is read.
inline constexpr uint64_t kExtentFileBytesMax = uint64_t{256} << 20;

struct VolumeExtent {
  std::string medium, file, grid;  // Names: the medium's, the scene's, and the file's.
  // The box of the grid's active voxels, in world space: lo > hi if there are none.
  Vec3d lo, hi;
  uint64_t active_voxel_count = 0;
};

// The densities of the media of files, in the order of the scene. Files that cannot be read are
// left out: InputChecks says why.
std::vector<VolumeExtent> VolumeExtents(const SceneDescription& scene, FileSource& files,
                                        VolumeReader* volumes);

// A line for people.
std::string FormatVolumeExtent(const VolumeExtent& extent);

}  // namespace sheaf::cli
