// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/sigmoid_spectrum.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"
#include "common/scene/spectrum/spectrum.h"

namespace sheaf::render {
namespace {

using Coefficients = SigmoidFitter::Coefficients;
using Vector3 = std::array<double, 3>;
using Matrix3 = std::array<std::array<double, 3>, 3>;

// Beyond this argument float arithmetic certainly gives 0 and 1 exactly.
constexpr double kSaturatedArgument = 1e30;
// Relative to the largest component; far below the precision of float coefficients.
constexpr double kResidualWanted = 1e-8;
constexpr int kStepCountMax = 200;
// Damping of the normal equations, relative to their diagonal.
constexpr double kDampingFirst = 1e-3, kDampingMin = 1e-12, kDampingMax = 1e12;
constexpr double kDampingFall = 0.1, kDampingRise = 8;

// Solves the damped normal equations (J^T J + damping diag(J^T J)) step = -J^T residual by L D L^T
// factorization. Returns false if they are singular.
bool SolveStep(const Matrix3& jacobian, const Vector3& residual, double damping, Vector3* step) {
  Matrix3 a{};
  Vector3 b{};
  for (size_t row = 0; row < 3; ++row) {
    for (size_t i = 0; i < 3; ++i) {
      b[row] -= jacobian[i][row] * residual[i];
      for (size_t col = 0; col < 3; ++col) a[row][col] += jacobian[i][row] * jacobian[i][col];
    }
    a[row][row] *= 1 + damping;
  }
  const double d0 = a[0][0];
  if (!(d0 > 0)) return false;
  const double l10 = a[1][0] / d0, l20 = a[2][0] / d0;
  const double d1 = a[1][1] - l10 * a[1][0];
  if (!(d1 > 0)) return false;
  const double l21 = (a[2][1] - l20 * a[1][0]) / d1;
  const double d2 = a[2][2] - l20 * a[2][0] - l21 * l21 * d1;
  if (!(d2 > 0)) return false;
  const double y1 = b[1] - l10 * b[0], y2 = b[2] - l20 * b[0] - l21 * y1;
  (*step)[2] = y2 / d2;
  (*step)[1] = y1 / d1 - l21 * (*step)[2];
  (*step)[0] = b[0] / d0 - l10 * (*step)[1] - l20 * (*step)[2];
  return true;
}

}  // namespace

SigmoidFitter::SigmoidFitter(int step_nm) {
  constexpr int kRangeNm = kSpectrumLastNm - kSpectrumFirstNm;
  SHEAF_CHECK(step_nm > 0 && kRangeNm % (2 * step_nm) == 0);
  nodes_.resize(static_cast<size_t>(kRangeNm / step_nm) + 1);
  for (size_t i = 0; i < nodes_.size(); ++i) {
    nodes_[i].t = static_cast<double>(i) / static_cast<double>(nodes_.size() - 1);
  }
  for (int offset = 0; offset <= kRangeNm; ++offset) {
    const double nm = kSpectrumFirstNm + offset;
    const double d65 = UnitD65(nm);
    const std::array<double, 3> observer = ObserverRgb(nm);
    // The parabola through three points, at u in [-1, 1] from the middle one.
    const auto first = std::min(static_cast<size_t>(offset / (2 * step_nm)) * 2, nodes_.size() - 3);
    const double u = static_cast<double>(offset) / step_nm - static_cast<double>(first + 1);
    const double lagrange[3] = {0.5 * u * (u - 1), (1 - u) * (1 + u), 0.5 * u * (u + 1)};
    for (size_t i = 0; i < 3; ++i) {
      for (size_t k = 0; k < 3; ++k) nodes_[first + i].weight[k] += lagrange[i] * d65 * observer[k];
    }
  }
}

SigmoidFitter::Residual SigmoidFitter::Evaluate(Rgb rgb, const Coefficients& c) const {
  std::array<Vector3, 3> moments{};  // [channel][power of t] of the sigmoid's derivative.
  Vector3 sum{};
  for (const Node& node : nodes_) {
    const double x = (c[2] * node.t + c[1]) * node.t + c[0];
    const double squared = 1 + x * x, root = std::sqrt(squared);
    const double low = 0.5 / (squared + std::fabs(x) * root);
    const double value = x < 0 ? low : 1 - low;
    const double derivative = 0.5 / (squared * root);
    for (size_t k = 0; k < 3; ++k) {
      sum[k] += node.weight[k] * value;
      const double moment = node.weight[k] * derivative;
      moments[k][0] += moment;
      moments[k][1] += moment * node.t;
      moments[k][2] += moment * node.t * node.t;
    }
  }
  const double scale = 1 / std::max(static_cast<double>(MaxComponent(rgb)), 1e-30);
  Residual residual;
  for (size_t k = 0; k < 3; ++k) {
    residual.value[k] = (sum[k] - rgb[k]) * scale;
    residual.squared += residual.value[k] * residual.value[k];
    for (size_t i = 0; i < 3; ++i) residual.derivative[k][i] = moments[k][i] * scale;
  }
  return residual;
}

// Levenberg 1944 and Marquardt 1963: Gauss-Newton where the model is accurate, short steps
// elsewhere.
Coefficients SigmoidFitter::FitFrom(Rgb rgb, const Coefficients& start) const {
  Coefficients c = start;
  Residual residual = Evaluate(rgb, c);
  double damping = kDampingFirst;
  for (int i = 0; i < kStepCountMax; ++i) {
    if (residual.squared < kResidualWanted * kResidualWanted || damping > kDampingMax) break;
    Vector3 step{};
    bool better = false;
    if (SolveStep(residual.derivative, residual.value, damping, &step)) {
      const Coefficients next = {c[0] + step[0], c[1] + step[1], c[2] + step[2]};
      const Residual next_residual = Evaluate(rgb, next);
      better = next_residual.squared < residual.squared;  // False for NaN.
      if (better) {
        c = next;
        residual = next_residual;
      }
    }
    damping = better ? std::max(damping * kDampingFall, kDampingMin) : damping * kDampingRise;
  }
  return c;
}

Coefficients SigmoidFitter::Fit(Rgb rgb) const {
  const double mean = (static_cast<double>(rgb.r) + rgb.g + rgb.b) / 3;
  return FitFrom(rgb, FitGray(mean));
}

namespace {

const SigmoidFitter& SharedFitter() {
  static const SigmoidFitter fitter(1);
  return fitter;
}
SigmoidSpectrum ToFloat(const Coefficients& c) {
  return {static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])};
}

}  // namespace

Coefficients FitGray(double value) {
  if (!(value > 0)) return {-kSaturatedArgument, 0, 0};
  if (value >= 1) return {kSaturatedArgument, 0, 0};
  return {(value - 0.5) / std::sqrt(value * (1 - value)), 0, 0};
}

SigmoidSpectrum FitSigmoid(Rgb rgb) {
  for (size_t i = 0; i < 3; ++i) rgb[i] = std::clamp(rgb[i], 0.f, 1.f);
  const bool is_gray = rgb.r == rgb.g && rgb.g == rgb.b;
  return ToFloat(is_gray ? FitGray(rgb.r) : SharedFitter().Fit(rgb));
}

SigmoidSpectrum FitSigmoidOutOfGamut(Rgb rgb) { return ToFloat(SharedFitter().Fit(rgb)); }

}  // namespace sheaf::render
