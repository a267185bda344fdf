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
#include "worker/render/medium/volume_cells.h"
#include "worker/render/sampling/discrete_distribution.h"

namespace sheaf::render {

class EmissiveVolumeSampler {
 public:
  // Must outlive the constructor call only.
  using Source = EmissiveDensity;
  // Cells of a source along its longest side.
  static constexpr int32_t kCellsAcross = 16;

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

 private:
  struct Cells {
    VolumeCells places;
    size_t first = 0;             // In choice_.
    std::vector<double> density;  // Density of samples, per volume of render space.
  };
  static double PdfOf(const Cells& cells, Vec3d p, Vec3d w);
  Vec3d PointAt(const std::array<float, 4>& u) const;

  std::vector<Cells> cells_;
  DiscreteDistribution choice_;  // Over the cells of all sources.
};

}  // namespace sheaf::render
