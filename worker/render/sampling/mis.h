// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PowerHeuristic: computed from the ratio of the pdfs, so that no square overflows or underflows.
// Source: Veach 1997, sec. 9.2.4.
#pragma once

#include <algorithm>
#include <cmath>

namespace sheaf::render {

// Weight in [0, 1] of a sample with pdf f that another technique would sample with pdf g (one
// sample each, beta = 2). Weights of the two techniques sum to 1. Requires: f, g >= 0. If both are
// 0 or both infinite, the weights are equal.
inline float PowerHeuristic(float f, float g) {
  if (f == g) return 0.5f;
  if (f > g) {
    const float ratio = g / f;
    return 1 / (1 + ratio * ratio);
  }
  const float ratio = f / g;
  return ratio * ratio / (1 + ratio * ratio);
}

// The same for three techniques: the weight of a sample with pdf f. If the largest pdf is infinite,
// the infinite ones share the weight equally.
inline double PowerHeuristic(double f, double g, double h) {
  const double largest = std::max(f, std::max(g, h));
  const auto square = [&](double pdf) {
    const double part = std::isinf(largest) ? (std::isinf(pdf) ? 1.0 : 0.0) : pdf / largest;
    return part * part;
  };
  if (!(largest > 0)) return 1.0 / 3;
  return square(f) / (square(f) + square(g) + square(h));
}

}  // namespace sheaf::render
