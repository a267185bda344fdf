// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Kernels of separable filters, and their application to lines of pixels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace sheaf {

// Even or odd about its center: weights[i] is the weight of +i; that of -i is the same, or its
// negative.
struct LineKernel {
  std::vector<float> weights;
  int32_t Radius() const { return static_cast<int32_t>(weights.size()) - 1; }
};

// exp(-x^2 / (2 deviation^2)) for |x| <= radius, scaled to the sum `total`. Truncated where it is
// negligible.
LineKernel GaussKernel(double deviation, int32_t radius, double total);
// Scaled so that the positive weights sum to 1 and the negative ones to -1. values: from the center
// on.
// Requires: an odd kernel is 0 at its center and of one sign to its right.
LineKernel BalancedKernel(const std::vector<double>& values, bool odd);

// out[x], for x below width, is the sum over i of the kernel's weight of i times line_at(i)[x]: the
// lines are neighbors, or one line shifted. Adds the lines at +i and -i before multiplying.
template <bool kOdd, typename LineAt>
void FilterLine(const LineKernel& kernel, int32_t width, const LineAt& line_at, float* out) {
  const float* middle = line_at(0);
  const float first = kernel.weights[0];
  for (int32_t x = 0; x < width; ++x) out[x] = first * middle[x];
  for (int32_t i = 1; i <= kernel.Radius(); ++i) {
    const float weight = kernel.weights[static_cast<size_t>(i)];
    const float* before = line_at(-i);
    const float* after = line_at(i);
    for (int32_t x = 0; x < width; ++x) {
      out[x] += weight * (kOdd ? after[x] - before[x] : after[x] + before[x]);
    }
  }
}

}  // namespace sheaf
