// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/upsampling_table.h"

#include <algorithm>
#include <cmath>

namespace sheaf::render {
namespace {

// 5 nm: the quadrature error is far below the interpolation error.
constexpr int kQuadratureStepNm = 5;

// Factor of the coefficients for interpolation. For white, where they are infinite, the factor
// stays positive, so that dividing by it gives large coefficients.
float InterpolationScale(float level, float x, float y) {
  constexpr float kSquaredMin = 1e-30f;
  return std::sqrt(std::max(level * (1 - level * (0.5f * (x + y))), kSquaredMin));
}

// Parabolas from both ends that join in the middle; maps [0, 1] to itself.
float Ease(float u) { return u < 0.5f ? 2 * u * u : 1 - 2 * (1 - u) * (1 - u); }
float InverseEase(float v) {
  const float side = std::copysign(1.f, v - 0.5f);  // Side of the middle; branch-free.
  const float from_end = std::sqrt(0.5f * (0.5f - std::fabs(v - 0.5f)));
  return 0.5f * (1 + side) - side * from_end;
}

}  // namespace

UpsamplingTable::Axis UpsamplingTable::Axis::Make(float first, float last) {
  Axis axis;
  axis.first = first;
  axis.width = last - first;
  for (size_t i = 0; i < kNodeCount; ++i) {
    const float u = static_cast<float>(i) / (kNodeCount - 1);
    axis.node[i] = first + axis.width * Ease(u);
  }
  axis.node.back() = last;
  return axis;
}

UpsamplingTable::Cell UpsamplingTable::CellAt(const Axis& axis, float value) {
  const float u = InverseEase((value - axis.first) / axis.width);
  const int index = std::min(static_cast<int>(u * (kNodeCount - 1)), int{kNodeCount} - 2);
  const auto node = static_cast<size_t>(index);
  // If rounding selected the neighboring cell, this extrapolates by the last bits of the value.
  return {node, (value - axis.node[node]) / (axis.node[node + 1] - axis.node[node])};
}

UpsamplingTable::UpsamplingTable()
    : fraction_(Axis::Make(0, 1)),
      level_(Axis::Make(kFitLevelMin, 1)),
      nodes_(3 * kNodeCount * kNodeCount * kNodeCount) {
  const SigmoidFitter fitter(kQuadratureStepNm);
  for (size_t cube = 0; cube < 3; ++cube) {
    for (size_t iy = 0; iy < kNodeCount; ++iy) {
      for (size_t ix = 0; ix < kNodeCount; ++ix) FitColumn(fitter, cube, ix, iy);
    }
  }
}

void UpsamplingTable::FitColumn(const SigmoidFitter& fitter, size_t cube, size_t ix, size_t iy) {
  const float x = fraction_.node[ix], y = fraction_.node[iy];
  const bool is_gray = x == 1 && y == 1;
  SigmoidFitter::Coefficients scaled{};
  const auto fit = [&](size_t iz, bool is_first) {
    const float level = level_.node[iz];
    const float scale = InterpolationScale(level, x, y);
    if (is_gray) {
      scaled = {level - 0.5, 0, 0};  // FitGray times scale; finite for white, too.
    } else {
      Rgb rgb;
      rgb[cube] = level;
      rgb[(cube + 1) % 3] = level * x;
      rgb[(cube + 2) % 3] = level * y;
      SigmoidFitter::Coefficients c = scaled;
      for (double& value : c) value /= scale;
      c = is_first ? fitter.Fit(rgb) : fitter.FitFrom(rgb, c);
      for (size_t i = 0; i < 3; ++i) scaled[i] = c[i] * scale;
    }
    Node& node = nodes_[IndexOf(cube, iz, iy, ix)];
    for (size_t i = 0; i < 3; ++i) node[i] = static_cast<float>(scaled[i]);
  };
  // From the middle, where fits are easiest, to both ends.
  constexpr size_t kMiddle = kNodeCount / 2;
  for (size_t iz = kMiddle; iz < kNodeCount; ++iz) fit(iz, iz == kMiddle);
  for (size_t iz = kMiddle + 1; iz-- > 0;) fit(iz, iz == kMiddle);
}

SigmoidSpectrum UpsamplingTable::At(Rgb rgb, float level) const {
  size_t cube = 0;
  float largest = rgb.r, x = rgb.g, y = rgb.b;
  if (!(rgb.r >= rgb.g && rgb.r >= rgb.b)) {
    const bool is_green = rgb.g >= rgb.b;
    cube = is_green ? 1 : 2;
    largest = is_green ? rgb.g : rgb.b;
    x = is_green ? rgb.b : rgb.r;
    y = is_green ? rgb.r : rgb.g;
  }
  x /= largest;
  y /= largest;
  const Cell cx = CellAt(fraction_, x), cy = CellAt(fraction_, y), cz = CellAt(level_, level);
  const float inverse_scale = 1 / InterpolationScale(level, x, y);
  const Node* corner = &nodes_[IndexOf(cube, cz.index, cy.index, cx.index)];
  Node sum{};
  for (size_t z = 0; z < 2; ++z) {
    for (size_t row = 0; row < 2; ++row) {
      const Node* pair = corner + (z * kNodeCount + row) * kNodeCount;
      const float weight =
          (z == 0 ? 1 - cz.part : cz.part) * (row == 0 ? 1 - cy.part : cy.part) * inverse_scale;
      for (size_t i = 0; i < 4; ++i) {
        sum[i] += weight * (pair[0][i] * (1 - cx.part) + pair[1][i] * cx.part);
      }
    }
  }
  return {sum[0], sum[1], sum[2]};
}

}  // namespace sheaf::render
