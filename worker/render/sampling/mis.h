// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The power heuristic in the form that holds for all magnitudes: from the ratio of the two pdfs, so
// that no square over- or underflows. Source: Veach 1997, sec. 9.2.4.
#pragma once

#include <algorithm>
#include <cmath>

namespace sheaf::render {

// Weight in [0, 1] of a sample drawn with pdf f that another technique would draw with pdf g (one
// sample each, beta = 2). Weights of the two techniques sum to 1. Requires: f, g >= 0. Where both
// are 0 or both infinite they share evenly.
inline float PowerHeuristic(float f, float g) {
  if (f == g) return 0.5f;
  if (f > g) {
    const float ratio = g / f;
    return 1 / (1 + ratio * ratio);
  }
  const float ratio = f / g;
  return ratio * ratio / (1 + ratio * ratio);
}

// The same among three techniques: the weight of a sample drawn with pdf f. Where the largest is
// infinite, those that are share evenly.
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
