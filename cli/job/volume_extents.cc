// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/volume_extents.h"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <system_error>
#include <variant>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/math/transform.h"
#include "common/volume/page_maker.h"

namespace sheaf::cli {
namespace {

bool IsReadForExtent(const std::string& path) {
  std::error_code error;
  const uint64_t bytes = std::filesystem::file_size(path, error);
  return !error && (bytes <= kExtentFileBytesMax || PageIndexBytes(path).has_value());
}

void SetBox(const Matrix4& world_from_index, const IndexBox& box, VolumeExtent* extent) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  extent->lo = {kFar, kFar, kFar};
  extent->hi = {-kFar, -kFar, -kFar};
  if (box.lo.x > box.hi.x) return;
  for (const double x : {box.lo.x, box.hi.x}) {
    for (const double y : {box.lo.y, box.hi.y}) {
      for (const double z : {box.lo.z, box.hi.z}) {
        const Vec3d p = TransformPoint(world_from_index, {x, y, z});
        for (size_t axis = 0; axis < 3; ++axis) {
          extent->lo[axis] = std::min(extent->lo[axis], p[axis]);
          extent->hi[axis] = std::max(extent->hi[axis], p[axis]);
        }
      }
    }
  }
}

}  // namespace

std::vector<VolumeExtent> VolumeExtents(const SceneDescription& scene, FileSource& files,
                                        VolumeReader* volumes) {
  std::vector<VolumeExtent> extents;
  for (const MediumDescription& medium : scene.media) {
    const auto* volume = std::get_if<VolumeFileMedium>(&medium.kind);
    if (volume == nullptr) continue;
    const absl::StatusOr<std::string> path = files.LocalPath(volume->file);
    if (!path.ok() || !IsReadForExtent(*path)) continue;
    const absl::StatusOr<VolumeGrid> grid =
        volumes->Read(volume->file, *path, volume->density_grid);
    if (!grid.ok()) continue;
    VolumeExtent extent{medium.name, volume->file, volume->density_grid, {}, {}};
    SetBox(medium.world_from_medium * grid->medium_from_index(), grid->box(), &extent);
    extent.active_voxel_count = grid->info().active_voxel_count;
    extents.push_back(std::move(extent));
  }
  return extents;
}

std::string FormatVolumeExtent(const VolumeExtent& extent) {
  const std::string what = absl::StrCat("medium \"", extent.medium, "\": ", extent.file,
                                        ", grid \"", extent.grid, "\": ");
  if (extent.lo.x > extent.hi.x) return absl::StrCat(what, "has no active voxels");
  const auto point = [](const Vec3d& p) {
    return absl::StrFormat("(%.4g, %.4g, %.4g)", p.x, p.y, p.z);
  };
  return absl::StrCat(what, extent.active_voxel_count, " voxels in the box from ", point(extent.lo),
                      " to ", point(extent.hi));
}

}  // namespace sheaf::cli
