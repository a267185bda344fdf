// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/filter_value.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/math/elementary.h"

namespace sheaf {
namespace {

double Gaussian(double x, double radius, double sigma) {
  const double k = -1 / (2 * sigma * sigma);
  return std::max(0.0, Exp(k * x * x * radius * radius) - Exp(k * radius * radius));
}
double Mitchell(double x, double b, double c) {
  x = 2 * std::fabs(x);
  if (x >= 2) return 0;
  if (x > 1) {
    return ((-b - 6 * c) * x * x * x + (6 * b + 30 * c) * x * x + (-12 * b - 48 * c) * x +
            (8 * b + 24 * c)) /
           6;
  }
  return ((12 - 9 * b - 6 * c) * x * x * x + (-18 + 12 * b + 6 * c) * x * x + (6 - 2 * b)) / 6;
}

double Sinc(double x) {
  // Below this, the next term of the series is less than a rounding.
  return x < 1e-8 ? 1 : SinCos(std::numbers::pi * x).sin / (std::numbers::pi * x);
}
double WindowedSinc(double x, double radius, double tau) {
  return Sinc(x * radius) * Sinc(x * radius / tau);
}

}  // namespace

double FilterValue(const FilterDescription& filter, double x, double radius_px) {
  switch (filter.kind) {
    case FilterDescription::Kind::kBox:
      return 1;
    case FilterDescription::Kind::kTriangle:
      return 1 - x;
    case FilterDescription::Kind::kGaussian:
      return Gaussian(x, radius_px, filter.sigma);
    case FilterDescription::Kind::kMitchell:
      return Mitchell(x, filter.b, filter.c);
    case FilterDescription::Kind::kSinc:
      return WindowedSinc(x, radius_px, filter.tau);
  }
  return 0;
}

}  // namespace sheaf
