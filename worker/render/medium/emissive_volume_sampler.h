// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmissiveVolumeSampler: samples directions from a point towards the scene's emissive grids. Each
// grid is cut into a few thousand cells; a cell is chosen by its emitted power, and a point in it
// uniformly; the path then gathers the emission along the whole ray through that point. The pdf is
// therefore that of the ray's direction, to which all cells on the ray contribute. Source: Simon et
// al. 2017, "Line Integration for Rendering Heterogeneous Emissive Volumes", sec. 5 (forward
// next-event estimation).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/medium/heterogeneous_medium.h"
#include "worker/render/medium/medium_emission.h"
#include "worker/render/sampling/discrete_distribution.h"

namespace sheaf::render {

class EmissiveVolumeSampler {
 public:
  // An emissive density. Both must outlive the constructor call only.
  struct Source {
    const HeterogeneousMedium* density = nullptr;
    const MediumEmission* emission = nullptr;
    Rgb sigma_a;  // For a density of 1.
  };
  // Cells of a source along its longest side, and the maximum number of points evaluated in all
  // cells.
  static constexpr int32_t kCellsAcross = 16;
  static constexpr int64_t kPlacesMax = int64_t{1} << 18;
  // Number of times at which a moving source is evaluated.
  static constexpr int kMoments = 4;

  EmissiveVolumeSampler() = default;
  explicit EmissiveVolumeSampler(const std::vector<Source>& sources);

  // Whether no emission was found.
  bool empty() const { return choice_.empty(); }
  uint64_t memory_bytes() const;

  struct Sample {
    Vec3f w;        // Unit.
    float pdf = 0;  // Pdf(p, w); 0 where there is no direction.
  };
  // p: in render space. Requires: !empty().
  Sample SampleFrom(Vec3f p, const std::array<float, 4>& u) const;
  // The pdf of SampleFrom, in solid angle. w: unit. 0 where the ray from p along w crosses no cell
  // in which emission was found.
  float Pdf(Vec3f p, Vec3f w) const;

  // A point where light paths begin; their directions are uniform.
  struct PointSample {
    Vec3f p;         // In render space.
    double pdf = 0;  // Per volume; 0 only where rounding moves the point out of its cell.
  };
  // Chooses a cell by its emitted power, and a point in it uniformly. Requires: !empty().
  PointSample SamplePoint(const std::array<float, 4>& u) const;
  // The pdf of SamplePoint; 0 outside the cells in which emission was found.
  double PdfPoint(Vec3f p) const;
  // Estimate of the emitted power without the absorption on the way: luminance times area, as that
  // of LightEmission.
  double power() const { return power_; }

 private:
  struct Cells {
    Affine cell_from_render, render_from_cell;  // Cells are unit cubes that start at the origin.
    std::array<int32_t, 3> counts{};
    size_t first = 0;             // In choice_.
    std::vector<double> density;  // Density of samples, per volume of render space; x slowest.
  };
  static Cells CutUp(const HeterogeneousMedium& medium);
  static void Weigh(const Source& source, const Cells& cells, std::vector<double>* powers);
  static double PdfOf(const Cells& cells, Vec3d p, Vec3d w);
  Vec3d PointAt(const std::array<float, 4>& u) const;

  std::vector<Cells> cells_;
  DiscreteDistribution choice_;  // Over the cells of all sources.
  double power_ = 0;
};

}  // namespace sheaf::render
