// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/agreement.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>

namespace sheaf::testing {
namespace {

constexpr int kFractionTermsMax = 1000;
// Estimates without noise agree if they differ by no more than accumulated float rounding.
constexpr double kRoundingTolerance = 1e-5;

// The continued fraction of the incomplete beta function, by Lentz's method. Source: Abramowitz and
// Stegun 26.5.8.
double BetaFraction(double a, double b, double x) {
  constexpr double kTiny = 1e-300;
  const auto away_from_zero = [](double v) { return std::fabs(v) < kTiny ? kTiny : v; };
  double c = 1, d = 1 / away_from_zero(1 - (a + b) * x / (a + 1)), fraction = d;
  for (int m = 1; m <= kFractionTermsMax; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    for (const double term : {even, odd}) {
      d = 1 / away_from_zero(1 + term * d);
      c = away_from_zero(1 + term / c);
      fraction *= c * d;
    }
    if (std::fabs(c * d - 1) < std::numeric_limits<double>::epsilon()) break;
  }
  return fraction;
}

// I_x(a, b), regularized.
double IncompleteBeta(double a, double b, double x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  const double front = std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) +
                                a * std::log(x) + b * std::log1p(-x));
  if (x < (a + 1) / (a + b + 2)) return front * BetaFraction(a, b, x) / a;
  return 1 - front * BetaFraction(b, a, 1 - x) / b;
}

bool AreEqualWithoutNoise(const TilePair& tile) {
  const double allowed =
      kRoundingTolerance * std::max(std::fabs(tile.a.mean), std::fabs(tile.b.mean));
  return tile.a.variance <= allowed * allowed && tile.b.variance <= allowed * allowed &&
         std::fabs(tile.a.mean - tile.b.mean) <= allowed;
}

}  // namespace

double StudentCdf(double t, double degrees_of_freedom) {
  const double tail = 0.5 * IncompleteBeta(0.5 * degrees_of_freedom, 0.5,
                                           degrees_of_freedom / (degrees_of_freedom + t * t));
  return t < 0 ? tail : 1 - tail;
}

Estimate EstimateOf(const std::vector<double>& draws) {
  const auto n = static_cast<double>(draws.size());
  double sum = 0, square_sum = 0;
  for (const double draw : draws) sum += draw;
  const double mean = sum / n;
  for (const double draw : draws) square_sum += (draw - mean) * (draw - mean);
  return {mean, square_sum / (n * (n - 1)), static_cast<int>(draws.size())};
}

double WelchP(const Estimate& a, const Estimate& b) {
  const double variance = a.variance + b.variance;
  const double degrees =
      variance * variance /
      (a.variance * a.variance / (a.count - 1) + b.variance * b.variance / (b.count - 1));
  return StudentCdf((b.mean - a.mean) / std::sqrt(variance), degrees);
}

double UniformityP(std::vector<double> p_values) {
  std::sort(p_values.begin(), p_values.end());
  const auto n = static_cast<double>(p_values.size());
  double distance = 0;
  for (size_t i = 0; i < p_values.size(); ++i) {
    const auto rank = static_cast<double>(i);
    distance = std::max({distance, p_values[i] - rank / n, (rank + 1) / n - p_values[i]});
  }
  const double lambda = (std::sqrt(n) + 0.12 + 0.11 / std::sqrt(n)) * distance;
  if (lambda < 0.2) return 1;  // The series converges slowly; it is 1 to 12 digits.
  double p = 0;
  for (int j = 1; j <= 100; ++j) {
    p += (j % 2 == 1 ? 2 : -2) * std::exp(-2.0 * j * j * lambda * lambda);
  }
  return std::clamp(p, 0.0, 1.0);
}

Agreement Compare(const std::vector<TilePair>& tiles, double planted) {
  Agreement agreement;
  std::vector<double> p_values;
  double extreme = 1, sum_a = 0, sum_b = 0;
  size_t furthest = 0;
  for (size_t i = 0; i < tiles.size(); ++i) {
    TilePair tile = tiles[i];
    tile.b.mean *= 1 + planted;
    tile.b.variance *= (1 + planted) * (1 + planted);
    sum_a += tile.a.mean;
    sum_b += tile.b.mean;
    if (AreEqualWithoutNoise(tile)) continue;
    const double p = WelchP(tile.a, tile.b);
    const double two_sided = 2 * std::min(p, 1 - p);
    if (two_sided < extreme) furthest = i;
    extreme = std::min(extreme, two_sided);
    p_values.push_back(p);
  }
  agreement.tiles = static_cast<int>(p_values.size());
  agreement.mean_ratio = sum_b / sum_a;
  agreement.uniformity_p = p_values.empty() ? 1 : UniformityP(p_values);
  agreement.extreme_p = -std::expm1(agreement.tiles * std::log1p(-extreme));
  const TilePair worst = tiles.empty() ? TilePair{} : tiles[furthest];
  char text[300];
  std::snprintf(text, sizeof(text),
                "%d tiles, uniformity p %.3g, ratio %.5f, furthest tile %zu (%.5f +- %.5f, %.5f +- "
                "%.5f) p %.3g",
                agreement.tiles, agreement.uniformity_p, agreement.mean_ratio, furthest,
                worst.a.mean, std::sqrt(worst.a.variance), worst.b.mean,
                std::sqrt(worst.b.variance), agreement.extreme_p);
  agreement.text = text;
  return agreement;
}

double PowerOf(const std::vector<TilePair>& tiles, double planted, double significance, int redraws,
               uint64_t seed) {
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> normal;
  // By Cochran's theorem the mean and its variance are independent.
  const auto redraw = [&](const Estimate& measured, double mean) {
    std::gamma_distribution<double> spread(0.5 * (measured.count - 1), 2.0 / (measured.count - 1));
    return Estimate{mean + std::sqrt(measured.variance) * normal(engine),
                    measured.variance * spread(engine), measured.count};
  };
  int found = 0;
  for (int i = 0; i < redraws; ++i) {
    std::vector<TilePair> drawn;
    for (const TilePair& tile : tiles) {
      const double mean = 0.5 * (tile.a.mean + tile.b.mean);
      drawn.push_back({redraw(tile.a, mean), redraw(tile.b, mean)});
    }
    found += Compare(drawn, planted).uniformity_p < significance;
  }
  return static_cast<double>(found) / redraws;
}

}  // namespace sheaf::testing
