// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmissionPoints: the points in emissive media at which light paths begin, in uniform directions,
// and their densities. Grids are cut into cells, homogeneous media have a box about each of their
// bodies. A cell or box is chosen by its emitted power, a point in it uniformly. A path that begins
// outside of the media, which fill a part of a box only, carries nothing.
//
// Emission along a line is found together, as the camera's paths integrate it: it is light whose
// rays carry the radiance that the media emit along them. A ray that reaches p may have begun
// anywhere on its line, so its density, per area perpendicular to the ray and solid angle, is the
// integral of the points' density along the line over 4 pi. It depends on the line alone, not on
// the point where the path began, so that the weights of all techniques are those of a line, too,
// and sum to 1 for each of its points. That needs points wherever there is emission: a part of the
// points is spread evenly over all cells with any density.
//
// Sources: Simon et al. 2017, "Line Integration for Rendering Heterogeneous Emissive Volumes";
// Veach 1997, sec. 9.2 (weights by any function of the sample); docs/adr/0093.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/medium/volume_cells.h"
#include "worker/render/sampling/discrete_distribution.h"

namespace sheaf::render {

class EmissionPoints {
 public:
  // A homogeneous emissive medium within a box of render space.
  struct Body {
    Vec3d lower, upper;
    double emission = 0;    // Luminance per length.
    double extinction = 0;  // Per length; its luminance.
  };
  // Cells of a density along its longest side.
  static constexpr int32_t kCellsAcross = 16;
  // The points that are spread evenly over the cells of each source, relative to those by power. A
  // source counts at least kLeastPower of the power of all.
  static constexpr double kEvenPoints = 1.0 / 16, kLeastPower = 0x1p-10;

  EmissionPoints() = default;
  // The densities must outlive the constructor call only.
  EmissionPoints(const std::vector<EmissiveDensity>& densities, const std::vector<Body>& bodies);

  // Whether no emission was found.
  bool empty() const { return choice_.empty(); }
  uint64_t memory_bytes() const;
  // Estimate of the power that leaves the media, as that of LightEmission. Thick bodies emit
  // through their surface only; the absorption of grids is not counted.
  double power() const { return power_; }

  struct Point {
    Vec3f p;         // In render space.
    double pdf = 0;  // Per volume; 0 only where rounding moves the point out of its cell.
  };
  // choice, u: independent numbers in [0, 1). Requires: !empty().
  Point Sample(double choice, const std::array<float, 3>& u) const;
  // The pdf of Sample; 0 outside the cells.
  double Pdf(Vec3f p) const;
  // The integral of the density along p + t w, t > 0; positive wherever light from there may be
  // emitted towards p. Light of thick bodies is attenuated on its way. w: unit.
  double LineDensity(Vec3f p, Vec3f w) const;

 private:
  struct Source {
    VolumeCells cells;
    size_t first = 0;             // In choice_.
    double extinction = 0;        // As for Body; 0 for grids.
    std::vector<double> density;  // By cell, per volume.
  };

  std::vector<Source> sources_;
  DiscreteDistribution choice_;  // Over the cells of all sources.
  double power_ = 0;
};

}  // namespace sheaf::render
