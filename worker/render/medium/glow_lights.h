// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GlowLights: where the scene's grids shine, as directions to look along from a point. Each grid is
// cut into a few thousand cells; a cell is chosen by the power it sends out, a point of it evenly,
// and the path then gathers what shines along the whole ray through that point. So what counts is
// the pdf of the ray's direction, which all cells on the ray have a part in. Source: Simon et al.
// 2017, "Line Integration for Rendering Heterogeneous Emissive Volumes", sec. 5 (forward next-event
// estimation).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/medium/medium_glow.h"
#include "worker/render/medium/varying_medium.h"
#include "worker/render/sampling/discrete_distribution.h"

namespace sheaf::render {

class GlowLights {
 public:
  // A density that shines. Both must live until the constructor is through.
  struct Source {
    const VaryingMedium* density = nullptr;
    const MediumGlow* glow = nullptr;
    Rgb sigma_a;  // Of a density of 1.
  };
  // Cells of a source along its longest side, and places that are looked at for all of them.
  static constexpr int32_t kCellsAcross = 16;
  static constexpr int64_t kPlacesMax = int64_t{1} << 18;
  // At which places of a source that moves are looked at.
  static constexpr int kMoments = 4;

  GlowLights() = default;
  explicit GlowLights(const std::vector<Source>& sources);

  // Whether nothing was seen to shine.
  bool empty() const { return choice_.empty(); }
  uint64_t memory_bytes() const;

  struct Sample {
    Vec3f w;        // Unit.
    float pdf = 0;  // Pdf(p, w); 0 where there is no direction.
  };
  // p: in render space. Requires: !empty().
  Sample SampleFrom(Vec3f p, const std::array<float, 4>& u) const;
  // Of SampleFrom, in solid angle. w: unit. 0 where the ray from p along w meets no cell that was
  // seen to shine.
  float Pdf(Vec3f p, Vec3f w) const;

 private:
  struct Cells {
    Affine cell_from_render, render_from_cell;  // Cells are unit cubes, from the origin on.
    std::array<int32_t, 3> counts{};
    size_t first = 0;             // In choice_.
    std::vector<double> density;  // Of points chosen, per volume of render space; x slowest.
  };
  static Cells CutUp(const VaryingMedium& medium);
  static void Weigh(const Source& source, const Cells& cells, std::vector<double>* powers);
  static double PdfOf(const Cells& cells, Vec3d p, Vec3d w);

  std::vector<Cells> cells_;
  DiscreteDistribution choice_;  // Over the cells of all sources.
};

}  // namespace sheaf::render
