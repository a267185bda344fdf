// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// UpsamplingTable: interpolates fits of sigmoid spectra to all colors. The layout follows Jakob and
// Hanika 2019: three cubes, by which component is the largest, over that component z and the ratios
// x, y of the other two to it. The interpolated quantity differs from theirs: coefficients grow
// like 1 / sqrt(z) towards black, where a sigmoid is 1 / (4 x^2), and as fast towards white, where
// it is 1 minus that. Multiplied by sqrt(z (1 - mean)), mean = z (x + y) / 2, they are bounded and
// nearly linear, and those of grays are exactly linear in z. Thus 33 nodes per side are more
// accurate than 64 of the plain coefficients, and grays stay gray.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"
#include "worker/render/color/sigmoid_spectrum.h"

namespace sheaf::render {

// Reflectances darker than this use the scaled spectrum of the color with the same ratios at this
// brightness. A sigmoid reaches saturated dark colors only with a bright line in the infrared that
// interpolation misses.
inline constexpr float kFitLevelMin = 1.f / 16;
// The largest component at which a color's ratios are fitted; its spectrum is the fit's, scaled by
// largest / level. Emission is fitted at one half, as in pbrt-v4.
// Requires: largest > 0, and at most 1 for reflectances within the gamut.
constexpr float FitLevel(float largest, ColorRole role) {
  if (role != ColorRole::kReflectance) return 0.5f;
  return largest > kFitLevelMin ? largest : kFitLevelMin;
}

// Thread safety: immutable.
class UpsamplingTable {
 public:
  // Cost: several hundred thousand fits, about half a second.
  UpsamplingTable();

  // Spectrum of the color with the ratios of rgb and the largest component level.
  // Requires: components >= 0, not all 0; kFitLevelMin <= level <= 1.
  SigmoidSpectrum At(Rgb rgb, float level) const;

 private:
  static constexpr size_t kNodeCount = 33;
  // c0, c1, c2 times the scale above; the fourth fills the vector register.
  using Node = std::array<float, 4>;
  // Nodes are dense at both ends, where saturated and light colors change fast.
  struct Axis {
    std::array<float, kNodeCount> node{};
    float first = 0, width = 1;

    static Axis Make(float first, float last);
  };
  struct Cell {
    size_t index;
    float part;  // 0 at the lower node, 1 at the upper one.
  };
  // Requires: value within the axis.
  static Cell CellAt(const Axis& axis, float value);
  // Fits the nodes of one cube and one pair of ratios, each starting from its neighbor's result.
  void FitColumn(const SigmoidFitter& fitter, size_t cube, size_t ix, size_t iy);
  static constexpr size_t IndexOf(size_t cube, size_t iz, size_t iy, size_t ix) {
    return ((cube * kNodeCount + iz) * kNodeCount + iy) * kNodeCount + ix;
  }

  Axis fraction_, level_;
  std::vector<Node> nodes_;
};

}  // namespace sheaf::render
