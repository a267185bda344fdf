// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VolumeMotion: the motion of a grid by a grid of velocities while the shutter is open, and the
// bounds of lookups in it. The value at x at fraction u of the shutter interval is the value at x -
// u * displacement(x) at shutter open, where the displacement is the velocity at x times the
// shutter duration: one step of semi-Lagrangian advection. Source: Kim and Ko 2007, "Eulerian
// Motion Blur".
//
// Spaces: *index* is the moving grid's. The velocity grid may have another transform.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "common/volume/volume_grid.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/medium/majorant_grid.h"

namespace sheaf::render {

// Maximum displacement, in voxels of the moving grid, while the shutter is open.
inline constexpr double kVolumeDisplacementMax = 1024;

// Whether p is in the box, faces included.
inline bool Contains(const IndexBox& box, Vec3d p) {
  return p.x >= box.lo.x && p.x <= box.hi.x && p.y >= box.lo.y && p.y <= box.hi.y &&
         p.z >= box.lo.z && p.z <= box.hi.z;
}

class VolumeMotion {
 public:
  // velocities: in the medium's space, 0 outside their own box plus a margin of one voxel.
  // duration: factor of the velocities, the shutter duration in their unit of time. Errors:
  // kInvalidArgument where they are not vectors or displacements exceed kVolumeDisplacementMax.
  // Messages begin with `where`.
  static absl::StatusOr<VolumeMotion> Make(const std::string& where, VolumeGrid velocities,
                                           double duration, const VolumeGrid& moving);

  VolumeGrid::Cursor MakeCursor() const { return VolumeGrid::Cursor(velocities_); }
  // Displacement since shutter open of the material that is at p at shutter close. Space: index.
  Vec3d DisplacementAt(Vec3d p, VolumeGrid::Cursor* cursor) const {
    const Vec3d at = velocity_index_from_index_.Point(p);
    if (!Contains(box_, at)) return {};
    return displacement_from_velocity_.Vector(ToDouble(velocities_.VectorAt(at, cursor)));
  }
  uint64_t memory_bytes() const { return velocities_.memory_bytes(); }

 private:
  friend class MovingDensitySource;
  explicit VolumeMotion(VolumeGrid velocities) : velocities_(std::move(velocities)) {}

  VolumeGrid velocities_;
  IndexBox box_;  // Box of velocities_.
  Affine velocity_index_from_index_;
  Affine displacement_from_velocity_;  // Without offset.
};

// Bounds of a moving grid over the whole shutter interval, from the bounds of the static grid.
// Requires: both outlive *this.
class MovingDensitySource : public DensitySource {
 public:
  MovingDensitySource(const MajorantGrid& still, const VolumeMotion& motion, int thread_count);

  // The box of the static grid, extended by the displacements.
  IndexBox Box() const override;
  DensityBounds Bounds() const override;
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const override;
  void BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const override;

 private:
  // Bounds of the displacements in a region.
  IndexBox DisplacementsIn(const IndexBox& region) const;
  IndexBox DisplacementsOf(const std::array<DensityBounds, 3>& velocities) const;

  const MajorantGrid& still_;
  const VolumeMotion& motion_;
  std::array<MajorantGrid, 3> velocities_;  // Bounds per component.
};

}  // namespace sheaf::render
