// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/chi_square.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/base/check.h"
#include "common/math/elementary.h"

namespace sheaf::testing {
namespace {

constexpr double kCountMin = 5;     // Minimum expected samples of an unpooled cell.
constexpr int kSubdivisionMax = 6;  // Maximum halvings of a cell in the quadrature.
// Tolerated error of a cell's expected count, in its standard deviations.
constexpr double kQuadratureErrorMax = 0.02;

// Five-point Gauss-Legendre on [0, 1].
constexpr double kGaussNode[5] = {0.046910077030668, 0.230765344947158, 0.5, 0.769234655052842,
                                  0.953089922969332};
constexpr double kGaussWeight[5] = {0.118463442528095, 0.239314335249683, 0.284444444444444,
                                    0.239314335249683, 0.118463442528095};

struct Box {
  double z0, z1, phi0, phi1;
};

double GaussOver(const DirectionPdf& pdf, const Box& box) {
  double sum = 0;
  for (int i = 0; i < 5; ++i) {
    const double z = box.z0 + (box.z1 - box.z0) * kGaussNode[i];
    const double r = std::sqrt(std::max(0.0, (1 - z) * (1 + z)));
    for (int j = 0; j < 5; ++j) {
      const SinCosPair<double> phi = SinCos(box.phi0 + (box.phi1 - box.phi0) * kGaussNode[j]);
      sum += kGaussWeight[i] * kGaussWeight[j] * pdf(ToFloat({r * phi.cos, r * phi.sin, z}));
    }
  }
  return sum * (box.z1 - box.z0) * (box.phi1 - box.phi0);
}

double AdaptiveOver(const DirectionPdf& pdf, const Box& box, double whole, double tolerance,
                    int level) {
  const double z = 0.5 * (box.z0 + box.z1), phi = 0.5 * (box.phi0 + box.phi1);
  const Box parts[4] = {{box.z0, z, box.phi0, phi},
                        {z, box.z1, box.phi0, phi},
                        {box.z0, z, phi, box.phi1},
                        {z, box.z1, phi, box.phi1}};
  double values[4], sum = 0;
  for (int i = 0; i < 4; ++i) sum += values[i] = GaussOver(pdf, parts[i]);
  if (level == kSubdivisionMax || std::fabs(sum - whole) <= tolerance) return sum;
  double refined = 0;
  for (int i = 0; i < 4; ++i) {
    refined += AdaptiveOver(pdf, parts[i], values[i], tolerance * 0.5, level + 1);
  }
  return refined;
}

std::vector<double> ExpectedCounts(const DirectionPdf& pdf, const ChiSquareGrid& grid,
                                   uint64_t sample_count) {
  std::vector<double> expected;
  const auto count = static_cast<double>(sample_count);
  const double dz = (grid.cos_max - grid.cos_min) / grid.cos_count;
  const double dphi = 2 * kPi / grid.phi_count;
  for (int i = 0; i < grid.cos_count; ++i) {
    for (int j = 0; j < grid.phi_count; ++j) {
      const Box box{grid.cos_min + i * dz, grid.cos_min + (i + 1) * dz, j * dphi, (j + 1) * dphi};
      const double guess = GaussOver(pdf, box);
      const double tolerance =
          kQuadratureErrorMax * std::sqrt(std::max(guess * count, 1.0)) / count;
      expected.push_back(AdaptiveOver(pdf, box, guess, tolerance, 0) * count);
    }
  }
  return expected;
}

// Has one element more than the grid has cells: the last counts draws without a direction.
// Directions outside the tested part are also counted there, so that the test detects them.
std::vector<double> ObservedCounts(const DirectionSampler& sample, const ChiSquareGrid& grid,
                                   uint64_t sample_count, uint64_t seed) {
  std::vector<double> observed(static_cast<size_t>(grid.cos_count * grid.phi_count) + 1);
  for (uint64_t i = 0; i < sample_count; ++i) {
    const std::optional<Vec3f> w = sample(CounterUniforms(seed, i));
    if (!w || w->z < grid.cos_min || w->z > grid.cos_max) {
      ++observed.back();
      continue;
    }
    const double along = (w->z - grid.cos_min) / (grid.cos_max - grid.cos_min);
    double phi = Atan2(static_cast<double>(w->y), static_cast<double>(w->x));
    if (phi < 0) phi += 2 * kPi;
    const int row = std::min(static_cast<int>(along * grid.cos_count), grid.cos_count - 1);
    const int column =
        std::min(static_cast<int>(phi / (2 * kPi) * grid.phi_count), grid.phi_count - 1);
    ++observed[static_cast<size_t>(row * grid.phi_count + column)];
  }
  return observed;
}

}  // namespace

std::array<float, 3> CounterUniforms(uint64_t seed, uint64_t index) {
  std::array<float, 3> u{};
  for (uint64_t i = 0; i < 3; ++i) {
    uint64_t state = (seed * 0xd1342543de82ef95u) + (index * 3 + i + 1) * 0x9e3779b97f4a7c15u;
    state = (state ^ (state >> 30)) * 0xbf58476d1ce4e5b9u;
    state = (state ^ (state >> 27)) * 0x94d049bb133111ebu;
    state ^= state >> 31;
    u[i] = static_cast<float>(state >> 40) * 0x1p-24f;
  }
  return u;
}

double UpperGammaQ(double a, double x) {
  SHEAF_CHECK(a > 0 && x >= 0);
  if (x == 0) return 1;
  const double scale = Exp(a * Log(x) - x - std::lgamma(a));
  if (x < a + 1) {
    double term = 1 / a, sum = term;
    for (int n = 1; n < 10000 && term > sum * 1e-16; ++n) sum += term *= x / (a + n);
    return 1 - scale * sum;
  }
  constexpr double kTiny = 1e-300;
  double b = x + 1 - a, c = 1 / kTiny, d = 1 / b, h = d;
  for (int n = 1; n < 10000; ++n) {
    const double an = -n * (n - a);
    b += 2;
    d = an * d + b;
    d = 1 / (std::fabs(d) < kTiny ? kTiny : d);
    c = b + an / c;
    if (std::fabs(c) < kTiny) c = kTiny;
    h *= d * c;
    if (std::fabs(d * c - 1) < 1e-15) break;
  }
  return scale * h;
}

double SidakThreshold(double significance, int test_count) {
  return -Expm1(Log1p(-significance) / test_count);
}

ChiSquareResult ChiSquareTest(const DirectionSampler& sample, const DirectionPdf& pdf,
                              const ChiSquareGrid& grid, uint64_t sample_count, uint64_t seed) {
  std::vector<double> expected = ExpectedCounts(pdf, grid, sample_count);
  const std::vector<double> observed = ObservedCounts(sample, grid, sample_count, seed);
  ChiSquareResult result;
  double total = 0;
  for (double count : expected) total += count;
  result.pdf_integral = total / static_cast<double>(sample_count);
  expected.push_back(std::max(0.0, static_cast<double>(sample_count) - total));

  double pooled_expected = 0, pooled_observed = 0;
  int cells = 0;
  const auto add = [&](double e, double o) {
    result.statistic += (o - e) * (o - e) / e;
    ++cells;
  };
  for (size_t i = 0; i < expected.size(); ++i) {
    if (expected[i] >= kCountMin) {
      add(expected[i], observed[i]);
    } else {
      pooled_expected += expected[i];
      pooled_observed += observed[i];
    }
  }
  // A pool that is itself too small tests nothing, unless samples fell where hardly any should.
  if (pooled_expected >= kCountMin) add(pooled_expected, pooled_observed);
  const bool impossible = pooled_expected < kCountMin && pooled_observed > 5 * kCountMin;
  result.degrees_of_freedom = std::max(cells - 1, 1);
  result.p_value =
      impossible ? 0 : UpperGammaQ(0.5 * result.degrees_of_freedom, 0.5 * result.statistic);
  result.text = "p " + std::to_string(result.p_value) + ", statistic " +
                std::to_string(result.statistic) + ", degrees of freedom " +
                std::to_string(result.degrees_of_freedom) + ", pdf integral " +
                std::to_string(result.pdf_integral) + ", pooled " +
                std::to_string(pooled_observed) + " of " + std::to_string(pooled_expected);
  return result;
}

}  // namespace sheaf::testing
