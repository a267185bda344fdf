// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VolumeMotion: how a grid moves by a grid of velocities while the shutter is open; and bounds of
// what is then looked up. What is seen at x at a share u of the shutter is what was at
// x - u * displacement(x) when it opened, the displacement being the velocity at x times the
// shutter's time: one step of semi-Lagrangian advection. Source: Kim and Ko 2007, "Eulerian Motion
// Blur".
//
// Spaces: *index* is the moving grid's. The velocities' grid may have another transform.
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

// Voxels of the moving grid that anything may come while the shutter is open.
inline constexpr double kVolumeDisplacementMax = 1024;

// Whether p lies in the box, faces included.
inline bool Contains(const IndexBox& box, Vec3d p) {
  return p.x >= box.lo.x && p.x <= box.hi.x && p.y >= box.lo.y && p.y <= box.hi.y &&
         p.z >= box.lo.z && p.z <= box.hi.z;
}

class VolumeMotion {
 public:
  // velocities: in the medium's space, 0 outside of their own box and a voxel around it. duration:
  // what they are multiplied by, the time that the shutter is open in the unit they are given for.
  // Errors: kInvalidArgument where they are no vectors or move anything farther than
  // kVolumeDisplacementMax. Messages begin with `where`.
  static absl::StatusOr<VolumeMotion> Make(const std::string& where, VolumeGrid velocities,
                                           double duration, const VolumeGrid& moving);

  VolumeGrid::Cursor MakeCursor() const { return VolumeGrid::Cursor(velocities_); }
  // How far what is at p as the shutter closes has come since it opened. Space: index.
  Vec3d DisplacementAt(Vec3d p, VolumeGrid::Cursor* cursor) const {
    const Vec3d at = velocity_index_from_index_.Point(p);
    if (!Contains(box_, at)) return {};
    return displacement_from_velocity_.Vector(ToDouble(velocities_.VectorAt(at, cursor)));
  }
  uint64_t memory_bytes() const { return velocities_.info().memory_bytes; }

 private:
  friend class MovingDensitySource;
  explicit VolumeMotion(VolumeGrid velocities) : velocities_(std::move(velocities)) {}

  VolumeGrid velocities_;
  IndexBox box_;  // Of velocities_.
  Affine velocity_index_from_index_;
  Affine displacement_from_velocity_;  // Without offset.
};

// What may be looked up of a grid that moves, at any time that the shutter is open, from bounds of
// the grid as it stands. Requires: both outlive it.
class MovingDensitySource : public DensitySource {
 public:
  MovingDensitySource(const MajorantGrid& still, const VolumeMotion& motion, int thread_count);

  // Grows by how far anything moves.
  IndexBox Box() const override;
  DensityBounds Bounds() const override;
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const override;
  void BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const override;

 private:
  // Of displacements in a region.
  IndexBox DisplacementsIn(const IndexBox& region) const;
  IndexBox DisplacementsOf(const std::array<DensityBounds, 3>& velocities) const;

  const MajorantGrid& still_;
  const VolumeMotion& motion_;
  std::array<MajorantGrid, 3> velocities_;  // Bounds by component.
};

}  // namespace sheaf::render
