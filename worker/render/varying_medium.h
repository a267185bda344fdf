// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VaryingMedium: a medium whose density varies: a grid or the procedural cloud, its bounds, and the
// way from the tracer's space to theirs. What a table of media holds for each such medium; colours
// stay with the table.
#pragma once

#include <optional>
#include <string>
#include <variant>

#include "absl/status/statusor.h"
#include "common/volume/volume_grid.h"
#include "worker/render/affine.h"
#include "worker/render/cloud_density.h"
#include "worker/render/delta_tracking.h"
#include "worker/render/majorant_grid.h"

namespace sheaf::render {

class VaryingMedium {
 public:
  struct Placement {
    Affine render_from_medium{};
    // The largest extinction that a density of 1 has, over colours, per unit of render space.
    double extinction_max = 1;
    int thread_count = 1;
    bool bound_once = false;  // One pair of bounds for all of it.
  };
  // Errors: kInvalidArgument where the density cannot be one (negative, vectors) or the transform
  // is singular. Messages begin with `where`.
  static absl::StatusOr<VaryingMedium> FromGrid(const std::string& where, VolumeGrid density,
                                                const Placement& placement);
  static absl::StatusOr<VaryingMedium> FromCloud(const std::string& where,
                                                 const CloudDensity& cloud,
                                                 const Placement& placement);
  uint64_t memory_bytes() const;
  const MajorantGrid& majorants() const { return majorants_; }
  // Index space is that of majorants().
  const Affine& index_from_render() const { return index_from_render_; }
  // The density, where it is the same in the whole box.
  std::optional<float> constant() const { return majorants_.constant(); }

  // Where a path that starts at o and flies to o + t_max d collides; see TrackFlight.
  // Space: render. sigma_t: per unit of density and of t. Requires: |o| is less than 2^38 voxels.
  // Thread safety: any number of threads at once.
  template <typename Color>
  TrackedFlight<Color> Fly(Vec3d o, Vec3d d, double t_max, const Color& sigma_t,
                           const Color& throughput, EventStream* stream,
                           TrackingTally* tally) const {
    return AlongRay(o, d, t_max, [&](MajorantWalk* walk, const auto& density) {
      return TrackFlight(walk, density, sigma_t, throughput, stream, tally);
    });
  }
  // An unbiased estimate of what passes; see TrackTransmittance.
  template <typename Color>
  Color Transmittance(Vec3d o, Vec3d d, double t_max, const Color& sigma_t, EventStream* stream,
                      TrackingTally* tally) const {
    return AlongRay(o, d, t_max, [&](MajorantWalk* walk, const auto& density) {
      return TrackTransmittance(walk, density, sigma_t, stream, tally);
    });
  }
  // An unbiased estimate of what arrives of what shines; see TrackEmission.
  template <typename Color, typename Source>
  Color Emission(Vec3d o, Vec3d d, double t_max, const Source& source, const Color& sigma_t,
                 EventStream* stream, TrackingTally* tally) const {
    return AlongRay(o, d, t_max, [&](MajorantWalk* walk, const auto& density) {
      return TrackEmission(walk, density, source, sigma_t, stream, tally);
    });
  }
  // At a point of render space; 0 outside of the box.
  double DensityAt(Vec3d p) const;

 private:
  VaryingMedium() = default;
  absl::Status Place(const std::string& where, const Placement& placement,
                     const Affine& medium_from_index, const DensitySource& source);

  template <typename Track>
  auto AlongRay(Vec3d o, Vec3d d, double t_max, const Track& track) const {
    const Vec3d o_index = index_from_render_.Point(o), d_index = index_from_render_.Vector(d);
    MajorantWalk walk(majorants_, o_index, d_index, 0, t_max);
    if (const auto* cloud = std::get_if<CloudDensity>(&density_)) {
      return track(&walk, [&](double t) {
        return cloud->At(cloud->index_offset() + (o_index + t * d_index) * cloud->voxel_size());
      });
    }
    const auto& grid = *std::get_if<VolumeGrid>(&density_);
    VolumeGrid::Cursor cursor(grid);
    return track(&walk, [&](double t) { return double{grid.At(o_index + t * d_index, &cursor)}; });
  }

  std::variant<std::monostate, VolumeGrid, CloudDensity> density_;
  MajorantGrid majorants_;
  Affine index_from_render_;
};

}  // namespace sheaf::render
