// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The power heuristic in the form that holds for all magnitudes: from the ratio of the two pdfs, so
// that no square over- or underflows. Source: Veach 1997, sec. 9.2.4.
#pragma once

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

}  // namespace sheaf::render
