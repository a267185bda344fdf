// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CloudDensity: the procedural cloud of pbrt-v4's "cloud" medium: sums of gradient noise, displaced
// by noise, thinned with height, and solid below height 1/2. The formulas are those of pbrt-v4's
// media.h; the noise is that of Perlin 2002 with our own hash in place of his permutation table, so
// a cloud has the look and the statistics of pbrt's but not its exact shape. Sources: Perlin 2002,
// "Improving noise"; Pharr, Jakob, Humphreys 2023, section 11.4.
#pragma once

#include <array>
#include <cstdint>

#include "common/math/vec.h"
#include "worker/render/medium/majorant_grid.h"

namespace sheaf::render {

// In [-1, 1]: between lattice points, |offset| weighted by the corners averages to at most 1/2 per
// axis, and gradients have two components of +-1.
double GradientNoise(Vec3d p);

class CloudDensity : public DensitySource {
 public:
  struct Parameters {
    double density = 1;
    double wispiness = 1;
    double frequency = 5;
    Vec3d lo{0, 0, 0}, hi{1, 1, 1};  // In medium space.
  };
  // Requires: lo < hi; parameters are finite and nonnegative.
  explicit CloudDensity(const Parameters& parameters);

  // At a point of medium space, in [0, 1].
  double At(Vec3d p_medium) const;
  // Index space: a voxel is 1/64 of the box's longest side.
  Vec3d index_offset() const { return parameters_.lo; }
  double voxel_size() const { return voxel_size_; }

  IndexBox Box() const override;
  DensityBounds Bounds() const override;
  std::optional<float> UniformValue(Index3 lo, Index3 hi) const override;
  void BlockBounds(Index3 origin, std::span<DensityBounds, 64> cells) const override;

 private:
  // Bounds over heights [y0, y1] of index space.
  DensityBounds BoundsOver(double y0, double y1) const;

  Parameters parameters_;
  double voxel_size_;
};

}  // namespace sheaf::render
