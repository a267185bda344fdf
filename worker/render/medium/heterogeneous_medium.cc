// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/heterogeneous_medium.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace sheaf::render {

absl::StatusOr<MajorantGrid::Options> HeterogeneousMedium::Place(const std::string& where,
                                                                 const Placement& placement,
                                                                 const Affine& medium_from_index) {
  render_from_index_ = placement.render_from_medium * medium_from_index;
  const double inverse = 1 / render_from_index_.Determinant();
  if (!std::isfinite(inverse)) {
    return absl::InvalidArgumentError(
        absl::StrCat(where,
                     ": the medium's transform is singular or not finite; give it a finite "
                     "transform without a scale of 0"));
  }
  index_from_render_ = Inverse(render_from_index_);
  const double voxel = std::max(
      {Length(render_from_index_.x), Length(render_from_index_.y), Length(render_from_index_.z)});
  MajorantGrid::Options options{.extinction_per_voxel = placement.extinction_max * voxel,
                                .thread_count = placement.thread_count};
  if (placement.bound_once) options.block_count_max = 0;
  return options;
}

absl::StatusOr<HeterogeneousMedium> HeterogeneousMedium::FromGrid(const std::string& where,
                                                                  VolumeGrid density,
                                                                  const Placement& placement) {
  const absl::Status sound = density.CheckDensity(where);
  if (!sound.ok()) return sound;
  HeterogeneousMedium medium;
  const auto options = medium.Place(where, placement, AffineOf(density.medium_from_index()));
  if (!options.ok()) return options.status();
  medium.majorants_ = MajorantGrid::Build(GridDensitySource(density), *options);
  density.AddOtherBytes(medium.majorants_.memory_bytes());
  medium.density_ = std::move(density);
  return medium;
}

absl::StatusOr<HeterogeneousMedium> HeterogeneousMedium::FromMovingGrid(
    const std::string& where, VolumeGrid density, VolumeMotion motion, const Placement& placement) {
  auto medium = FromGrid(where, std::move(density), placement);
  if (!medium.ok()) return medium;
  const auto& grid = *std::get_if<VolumeGrid>(&medium->density_);
  const auto options = medium->Place(where, placement, AffineOf(grid.medium_from_index()));
  if (!options.ok()) return options.status();
  const MovingDensitySource source(medium->majorants_, motion, placement.thread_count);
  MajorantGrid moving = MajorantGrid::Build(source, *options);
  medium->majorants_ = std::move(moving);
  medium->motion_ = std::make_unique<const VolumeMotion>(std::move(motion));
  return medium;
}

absl::StatusOr<HeterogeneousMedium> HeterogeneousMedium::FromCloud(const std::string& where,
                                                                   const CloudDensity& cloud,
                                                                   const Placement& placement) {
  const double voxel = cloud.voxel_size();
  HeterogeneousMedium medium;
  const auto options = medium.Place(
      where, placement, {{voxel, 0, 0}, {0, voxel, 0}, {0, 0, voxel}, cloud.index_offset()});
  if (!options.ok()) return options.status();
  medium.majorants_ = MajorantGrid::Build(cloud, *options);
  medium.density_ = cloud;
  return medium;
}

uint64_t HeterogeneousMedium::memory_bytes() const {
  const auto* grid = std::get_if<VolumeGrid>(&density_);
  return majorants_.memory_bytes() + (grid != nullptr ? grid->memory_bytes() : 0) +
         (moves() ? motion_->memory_bytes() : 0);
}

double HeterogeneousMedium::MeanDensity() const {
  const auto* grid = std::get_if<VolumeGrid>(&density_);
  if (grid != nullptr && !moves()) return grid->MeanValue();
  constexpr int kPlacesAcross = 16;
  const Vec3d lo = majorants_.box().lo, size = majorants_.box().hi - lo;
  const auto at = [&](size_t axis, int i) {
    return lo[axis] + (i + 0.5) / kPlacesAcross * size[axis];
  };
  double sum = 0;
  for (int x = 0; x < kPlacesAcross; ++x) {
    for (int y = 0; y < kPlacesAcross; ++y) {
      for (int z = 0; z < kPlacesAcross; ++z) {
        sum += DensityAt(render_from_index_.Point({at(0, x), at(1, y), at(2, z)}), 0.5);
      }
    }
  }
  return sum / (kPlacesAcross * kPlacesAcross * kPlacesAcross);
}

double HeterogeneousMedium::GuessDepth(Vec3d o, Vec3d d, double t_max, double sigma_t) const {
  constexpr double kFreePaths = 4;
  const double rate = sigma_t * static_cast<double>(majorants_.bounds().upper);
  if (moves() || !(rate > 0)) return 0;
  const double length = std::min(t_max, kFreePaths / rate);
  const double sum = DensityAt(o + 0.25 * length * d) + DensityAt(o + 0.75 * length * d);
  return sigma_t * length * 0.5 * sum;
}

bool HeterogeneousMedium::ClipToBox(Vec3d o, Vec3d d, double* t0, double* t1) const {
  const Vec3d o_index = index_from_render_.Point(o), d_index = index_from_render_.Vector(d);
  const IndexBox& box = majorants_.box();
  for (size_t a = 0; a < 3; ++a) {
    const double inverse = 1 / d_index[a];
    if (!std::isfinite(inverse)) {
      if (!(o_index[a] >= box.lo[a] && o_index[a] <= box.hi[a])) return false;
      continue;
    }
    const double lo = (box.lo[a] - o_index[a]) * inverse, hi = (box.hi[a] - o_index[a]) * inverse;
    *t0 = std::max(*t0, std::min(lo, hi));
    *t1 = std::min(*t1, std::max(lo, hi));
  }
  return *t0 < *t1;
}

double HeterogeneousMedium::DensityAt(Vec3d p) const {
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

double HeterogeneousMedium::DensityAt(Vec3d p, double time) const {
  if (!moves()) return DensityAt(p);
  MovingCursor cursor{VolumeGrid::Cursor(*std::get_if<VolumeGrid>(&density_)),
                      motion_->MakeCursor()};
  return MovedDensityAt(index_from_render_.Point(p), time, &cursor);
}

Vec3d HeterogeneousMedium::OriginOf(Vec3d p, double time) const {
  if (!moves()) return p;
  VolumeGrid::Cursor cursor = motion_->MakeCursor();
  const Vec3d displacement = motion_->DisplacementAt(index_from_render_.Point(p), &cursor);
  return p - render_from_index_.Vector(time * displacement);
}

}  // namespace sheaf::render
