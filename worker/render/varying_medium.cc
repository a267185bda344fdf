// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/varying_medium.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace sheaf::render {

absl::Status VaryingMedium::Place(const std::string& where, const Placement& placement,
                                  const Affine& medium_from_index, const DensitySource& source) {
  const Affine render_from_index = placement.render_from_medium * medium_from_index;
  const double inverse = 1 / render_from_index.Determinant();
  if (!std::isfinite(inverse)) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, ": the medium's transform is singular or not finite; scale it by something else"));
  }
  index_from_render_ = Inverse(render_from_index);
  const double voxel = std::max(
      {Length(render_from_index.x), Length(render_from_index.y), Length(render_from_index.z)});
  MajorantGrid::Options options{.extinction_per_voxel = placement.extinction_max * voxel,
                                .thread_count = placement.thread_count};
  if (placement.bound_once) options.block_count_max = 0;
  majorants_ = MajorantGrid::Build(source, options);
  return absl::OkStatus();
}

absl::StatusOr<VaryingMedium> VaryingMedium::FromGrid(const std::string& where, VolumeGrid density,
                                                      const Placement& placement) {
  const absl::Status sound = density.CheckDensity(where);
  if (!sound.ok()) return sound;
  VaryingMedium medium;
  const absl::Status placed = medium.Place(where, placement, AffineOf(density.medium_from_index()),
                                           GridDensitySource(density));
  if (!placed.ok()) return placed;
  medium.density_ = std::move(density);
  return medium;
}

absl::StatusOr<VaryingMedium> VaryingMedium::FromCloud(const std::string& where,
                                                       const CloudDensity& cloud,
                                                       const Placement& placement) {
  const double voxel = cloud.voxel_size();
  VaryingMedium medium;
  const absl::Status placed = medium.Place(
      where, placement, {{voxel, 0, 0}, {0, voxel, 0}, {0, 0, voxel}, cloud.index_offset()}, cloud);
  if (!placed.ok()) return placed;
  medium.density_ = cloud;
  return medium;
}

uint64_t VaryingMedium::memory_bytes() const {
  const auto* grid = std::get_if<VolumeGrid>(&density_);
  return majorants_.memory_bytes() + (grid != nullptr ? grid->info().memory_bytes : 0);
}

double VaryingMedium::DensityAt(Vec3d p) const {
  const Vec3d index = index_from_render_.Point(p);
  const IndexBox& box = majorants_.box();
  for (size_t a = 0; a < 3; ++a) {
    if (!(index[a] >= box.lo[a] && index[a] <= box.hi[a])) return 0;
  }
  if (const auto* cloud = std::get_if<CloudDensity>(&density_)) {
    return cloud->At(cloud->index_offset() + index * cloud->voxel_size());
  }
  const auto& grid = *std::get_if<VolumeGrid>(&density_);
  VolumeGrid::Cursor cursor(grid);
  return grid.At(index, &cursor);
}

}  // namespace sheaf::render
