// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Pearson's chi-square test of a direction sampler against its density: samples are counted in
// cells of equal solid angle, the density is integrated over each cell by adaptive quadrature, and
// the two must agree within chance. If the density integrates to less than 1, the rest must be
// matched by draws that give no direction.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "common/math/vec.h"

namespace sheaf::testing {

struct ChiSquareResult {
  double p_value = 0;
  double statistic = 0;
  int degrees_of_freedom = 0;
  double pdf_integral = 0;  // Over the sphere.
  std::string text;         // The result in one line, for messages.
};

struct ChiSquareGrid {
  // Number of cells over cos theta and phi; odd, so that no cell edge lies on a symmetry of the
  // sampler.
  int cos_count = 21, phi_count = 43;
  // The part of the sphere that is tested; the density must vanish elsewhere.
  double cos_min = -1, cos_max = 1;
};

// Maps three independent uniforms in [0, 1) to a direction; nullopt if the draw gives none.
using DirectionSampler = std::function<std::optional<Vec3f>(std::array<float, 3> u)>;
// Density per solid angle.
using DirectionPdf = std::function<double(Vec3f)>;

// Cells with fewer than 5 expected samples are pooled. seed: determines the draws.
ChiSquareResult ChiSquareTest(const DirectionSampler& sample, const DirectionPdf& pdf,
                              const ChiSquareGrid& grid, uint64_t sample_count, uint64_t seed = 1);

// The p-value threshold for each of test_count tests at this overall significance. Source: Sidak
// 1967.
double SidakThreshold(double significance, int test_count);

// Q(a, x), the regularized upper incomplete gamma function; a > 0, x >= 0. Accurate to about 1e-12.
// Source: Abramowitz and Stegun 6.5.29 (series) and 6.5.31 (continued fraction, Lentz's method).
double UpperGammaQ(double a, double x);

// Three uniforms of 24 bits each, from a counter: draw i of a stream is independent of the number
// of other draws. Source: the mixer of SplitMix64, Steele, Lea and Flood 2014.
std::array<float, 3> CounterUniforms(uint64_t seed, uint64_t index);

}  // namespace sheaf::testing
