// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/volume_motion.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/parallel.h"

namespace sheaf::render {
namespace {

// Regions are divided where that narrows the displacement bounds by about this many voxels.
constexpr double kFineDisplacement = 0.125;

// Positions at shutter open of all material that may be in the region at any time.
IndexBox Origins(const IndexBox& region, const IndexBox& displacements) {
  IndexBox origins;
  for (size_t a = 0; a < 3; ++a) {
    origins.lo[a] = region.lo[a] - std::max(displacements.hi[a], 0.0);
    origins.hi[a] = region.hi[a] - std::min(displacements.lo[a], 0.0);
  }
  return origins;
}

double RowSum(const Affine& m, size_t row) {
  return std::fabs(m.x[row]) + std::fabs(m.y[row]) + std::fabs(m.z[row]);
}

}  // namespace

absl::StatusOr<VolumeMotion> VolumeMotion::Make(const std::string& where, VolumeGrid velocities,
                                                double duration, const VolumeGrid& moving) {
  const std::string grid = absl::StrCat(where, ": grid \"", velocities.info().name, "\"");
  if (!velocities.is_vector()) {
    return absl::InvalidArgumentError(
        absl::StrCat(grid, " holds numbers, but velocities are vectors; name a grid of vectors"));
  }
  VolumeMotion motion(std::move(velocities));
  const VolumeGrid& v = motion.velocities_;
  for (size_t a = 0; a < 3; ++a) {
    motion.box_.lo[a] = std::ceil(v.box().lo[a]) - 1;
    motion.box_.hi[a] = std::ceil(v.box().hi[a]);
  }
  motion.velocity_index_from_index_ =
      AffineOf(v.index_from_medium()) * AffineOf(moving.medium_from_index());
  Affine& m = motion.displacement_from_velocity_;
  m = AffineOf(moving.index_from_medium());
  m = {m.x * duration, m.y * duration, m.z * duration, {0, 0, 0}};
  for (size_t row = 0; row < 3; ++row) {
    const double voxels =
        Length(Vec3d{m.x[row], m.y[row], m.z[row]}) * static_cast<double>(v.info().values.max);
    if (voxels <= kVolumeDisplacementMax) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        grid, " moves the medium by up to ", voxels,
        " voxels while the shutter is open, more than the limit of ", kVolumeDisplacementMax,
        "; give a smaller \"velocityscale\" or open the shutter for less time"));
  }
  return motion;
}

MovingDensitySource::MovingDensitySource(const MajorantGrid& still, const VolumeMotion& motion,
                                         int thread_count)
    : still_(still), motion_(motion) {
  double voxels_per_velocity = 0;
  for (size_t row = 0; row < 3; ++row) {
    voxels_per_velocity =
        std::max(voxels_per_velocity, RowSum(motion.displacement_from_velocity_, row));
  }
  const MajorantGrid::Options options{
      .extinction_per_voxel = voxels_per_velocity / kFineDisplacement,
      .thread_count = thread_count};
  ParallelRanges(3, 1, thread_count, [&](uint64_t c, uint64_t) {
    const ComponentSource component(motion.velocities_, c, motion.box_);
    velocities_[c] = MajorantGrid::Build(component, options);
  });
}

IndexBox MovingDensitySource::DisplacementsOf(
    const std::array<DensityBounds, 3>& velocities) const {
  const Affine& m = motion_.displacement_from_velocity_;
  const std::array<Vec3d, 3> columns{m.x, m.y, m.z};
  IndexBox sum{{0, 0, 0}, {0, 0, 0}};
  for (size_t c = 0; c < 3; ++c) {
    for (size_t a = 0; a < 3; ++a) {
      const double p = columns[c][a] * static_cast<double>(velocities[c].lower);
      const double q = columns[c][a] * static_cast<double>(velocities[c].upper);
      sum.lo[a] += std::min(p, q);
      sum.hi[a] += std::max(p, q);
    }
  }
  return sum;
}

IndexBox MovingDensitySource::DisplacementsIn(const IndexBox& region) const {
  const Affine& m = motion_.velocity_index_from_index_;
  const Vec3d middle = m.Point((region.lo + region.hi) * 0.5);
  const Vec3d half = (region.hi - region.lo) * 0.5;
  IndexBox there;
  for (size_t a = 0; a < 3; ++a) {
    const double reach =
        std::fabs(m.x[a]) * half.x + std::fabs(m.y[a]) * half.y + std::fabs(m.z[a]) * half.z;
    there.lo[a] = middle[a] - reach;
    there.hi[a] = middle[a] + reach;
  }
  std::array<DensityBounds, 3> bounds;
  for (size_t c = 0; c < 3; ++c) bounds[c] = velocities_[c].BoundsOver(there);
  return DisplacementsOf(bounds);
}

IndexBox MovingDensitySource::Box() const {
  const IndexBox& box = still_.box();
  for (size_t a = 0; a < 3; ++a) {
    if (!(box.lo[a] < box.hi[a])) return box;
  }
  std::array<DensityBounds, 3> all;
  for (size_t c = 0; c < 3; ++c) all[c] = velocities_[c].bounds();
  const IndexBox displacements = DisplacementsOf(all);
  // The material at x comes from x - d, so the material of the box reaches all x in box + d.
  IndexBox grown;
  for (size_t a = 0; a < 3; ++a) {
    grown.lo[a] = box.lo[a] + std::min(displacements.lo[a], 0.0);
    grown.hi[a] = box.hi[a] + std::max(displacements.hi[a], 0.0);
  }
  return grown;
}

DensityBounds MovingDensitySource::Bounds() const {
  const DensityBounds bounds = still_.bounds();
  return {std::min(bounds.lower, 0.0f), std::max(bounds.upper, 0.0f)};
}

std::optional<float> MovingDensitySource::UniformValue(Index3 lo, Index3 hi) const {
  const IndexBox region{{double(lo[0]), double(lo[1]), double(lo[2])},
                        {double(hi[0]), double(hi[1]), double(hi[2])}};
  const DensityBounds bounds = still_.BoundsOver(Origins(region, DisplacementsIn(region)));
  if (bounds.lower != bounds.upper) return std::nullopt;
  return bounds.upper;
}

void MovingDensitySource::BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const {
  constexpr double kFine = 2;
  const Vec3d lo{double(origin[0]), double(origin[1]), double(origin[2])};
  const auto bounds_at = [&](Vec3d from, double side) {
    const IndexBox region{from, from + Vec3d{side, side, side}};
    return still_.BoundsOver(Origins(region, DisplacementsIn(region)));
  };
  // Bounds of neighboring cells that reach far beyond them are almost equal: computed once for
  // several.
  const IndexBox region{lo, lo + Vec3d{4, 4, 4} * kFine};
  const IndexBox way = DisplacementsIn(region);
  double reach = 0;
  for (size_t a = 0; a < 3; ++a) reach = std::max({reach, way.hi[a], -way.lo[a]});
  const int32_t step = reach < 4 * kFine ? 1 : reach < 16 * kFine ? 2 : 4;
  for (int32_t x = 0; x < 4; x += step) {
    for (int32_t y = 0; y < 4; y += step) {
      for (int32_t z = 0; z < 4; z += step) {
        const DensityBounds bounds =
            bounds_at(lo + Vec3d{double(x), double(y), double(z)} * kFine, kFine * step);
        for (int32_t c = 0; c < step * step * step; ++c) {
          const int32_t i = x + c / (step * step), j = y + c / step % step, k = z + c % step;
          cells[static_cast<size_t>((i << 4) | (j << 2) | k)] = bounds;
        }
      }
    }
  }
}

}  // namespace sheaf::render
