// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HeterogeneousMedium: a heterogeneous medium: a grid or the procedural cloud, its density bounds,
// and the transforms from render space. MediumTable holds one for each such density, and the colors
// separately. A grid may move while the shutter is open: then rays carry a time.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>

#include "absl/status/statusor.h"
#include "common/volume/volume_grid.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/medium/cloud_density.h"
#include "worker/render/medium/delta_tracking.h"
#include "worker/render/medium/majorant_grid.h"
#include "worker/render/medium/volume_motion.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

// The time of a ray as a fraction of the shutter interval; NoTime where no medium moves.
struct NoTime {};
template <TraitBits kTraits>
auto TimeOfMedia([[maybe_unused]] float shutter_fraction) {
  if constexpr (Has(kTraits, Trait::kMovingVolumes)) {
    return static_cast<double>(shutter_fraction);
  } else {
    return NoTime{};
  }
}

class HeterogeneousMedium {
 public:
  struct Placement {
    Affine render_from_medium{};
    // The largest extinction of a density of 1, over color components, per unit of render space.
    double extinction_max = 1;
    int thread_count = 1;
    bool bound_once = false;  // A single pair of bounds for the whole medium.
  };
  // Errors: kInvalidArgument where the density is invalid (negative, or vectors) or the transform
  // is singular. Messages begin with `where`.
  static absl::StatusOr<HeterogeneousMedium> FromGrid(const std::string& where, VolumeGrid density,
                                                      const Placement& placement);
  // The same for a moving grid.
  static absl::StatusOr<HeterogeneousMedium> FromMovingGrid(const std::string& where,
                                                            VolumeGrid density, VolumeMotion motion,
                                                            const Placement& placement);
  static absl::StatusOr<HeterogeneousMedium> FromCloud(const std::string& where,
                                                       const CloudDensity& cloud,
                                                       const Placement& placement);
  uint64_t memory_bytes() const;
  const MajorantGrid& majorants() const { return majorants_; }
  // Index space is that of majorants().
  const Affine& render_from_index() const { return render_from_index_; }
  // The density if it is the same in the whole box.
  std::optional<float> constant() const { return majorants_.constant(); }

  bool moves() const { return motion_ != nullptr; }

  // Requires, here and below: the time is in [0, 1], or NoTime and !moves(). Samples a collision of
  // a path from o to o + t_max d; see TrackCollision. Space: render. sigma_t: per unit of density
  // and of t. Requires: |o| is less than 2^38 voxels. Thread safety: any number of threads at once.
  template <typename Color, typename Time = NoTime>
  TrackedCollision<Color> SampleCollision(Vec3d o, Vec3d d, double t_max, const Color& sigma_t,
                                          const Color& throughput, EventStream* stream,
                                          TrackingTally* tally, Time time = {}) const {
    return AlongRay(o, d, t_max, time, [&](MajorantWalk* walk, const auto& density) {
      return TrackCollision(walk, density, sigma_t, throughput, stream, tally);
    });
  }
  // An unbiased estimate of the transmittance; see TrackTransmittance.
  template <typename Color, typename Time = NoTime>
  Color Transmittance(Vec3d o, Vec3d d, double t_max, const Color& sigma_t, EventStream* stream,
                      TrackingTally* tally, Time time = {}) const {
    return AlongRay(o, d, t_max, time, [&](MajorantWalk* walk, const auto& density) {
      return TrackTransmittance(walk, density, sigma_t, stream, tally);
    });
  }
  // A guess of the optical depth for sigma_t from o towards o + t_max d, by two densities on its
  // first part: at most as far as four free paths at the largest density. 0 where the medium moves.
  double GuessDepth(Vec3d o, Vec3d d, double t_max, double sigma_t) const;
  // An unbiased estimate of the emission that arrives at o; see TrackEmission.
  template <typename Color, typename Source, typename Time = NoTime>
  Color Emission(Vec3d o, Vec3d d, double t_max, const Source& source, const Color& sigma_t,
                 EventStream* stream, TrackingTally* tally, Time time = {}) const {
    return AlongRay(o, d, t_max, time, [&](MajorantWalk* walk, const auto& density) {
      return TrackEmission(walk, density, source, sigma_t, stream, tally);
    });
  }
  // Mean over the box at the middle of the shutter interval.
  double MeanDensity() const;
  // Clips [*t0, *t1] to the part where o + t d is in the box. Returns false if that is empty.
  bool ClipToBox(Vec3d o, Vec3d d, double* t0, double* t1) const;
  // Density at a point of render space; 0 outside the box.
  double DensityAt(Vec3d p) const;
  double DensityAt(Vec3d p, NoTime) const { return DensityAt(p); }
  double DensityAt(Vec3d p, double time) const;
  // Position at shutter open, in render space, of the material that is at p at the given time.
  Vec3d OriginOf(Vec3d p, NoTime) const { return p; }
  Vec3d OriginOf(Vec3d p, double time) const;

 private:
  HeterogeneousMedium() = default;
  // Sets the transforms; returns the options for building bounds.
  absl::StatusOr<MajorantGrid::Options> Place(const std::string& where, const Placement& placement,
                                              const Affine& medium_from_index);
  struct MovingCursor {
    VolumeGrid::Cursor density, velocity;
  };
  // Density at a point of index space. Requires: moves().
  double MovedDensityAt(Vec3d p, double time, MovingCursor* cursor) const {
    const Vec3d origin = p - time * motion_->DisplacementAt(p, &cursor->velocity);
    const auto& grid = *std::get_if<VolumeGrid>(&density_);
    return Contains(grid.box(), origin) ? double{grid.At(origin, &cursor->density)} : 0;
  }

  template <typename Time, typename Track>
  auto AlongRay(Vec3d o, Vec3d d, double t_max, [[maybe_unused]] Time time,
                const Track& track) const {
    const Vec3d o_index = index_from_render_.Point(o), d_index = index_from_render_.Vector(d);
    MajorantWalk walk(majorants_, o_index, d_index, 0, t_max);
    if (const auto* cloud = std::get_if<CloudDensity>(&density_)) {
      return track(&walk, [&](double t) {
        return cloud->At(cloud->index_offset() + (o_index + t * d_index) * cloud->voxel_size());
      });
    }
    const auto& grid = *std::get_if<VolumeGrid>(&density_);
    if constexpr (std::is_same_v<Time, double>) {
      if (moves()) {
        MovingCursor cursor{VolumeGrid::Cursor(grid), motion_->MakeCursor()};
        return track(
            &walk, [&](double t) { return MovedDensityAt(o_index + t * d_index, time, &cursor); });
      }
    }
    VolumeGrid::Cursor cursor(grid);
    return track(&walk, [&](double t) { return double{grid.At(o_index + t * d_index, &cursor)}; });
  }

  std::variant<std::monostate, VolumeGrid, CloudDensity> density_;
  std::unique_ptr<const VolumeMotion> motion_;  // Null if static; else of the grid.
  MajorantGrid majorants_;
  Affine index_from_render_, render_from_index_;
};

}  // namespace sheaf::render
