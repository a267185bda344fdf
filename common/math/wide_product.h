// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WideProduct: a value times its filter weight, as the sums of the film add it.
#pragma once

#include <cmath>

namespace sheaf {

// A product of two floats has 48 bits and is a DoubleFloat's value as it is, unless its tail is
// below the least float. So negligible products become 0 (and -0 becomes 0).
inline double WideProduct(float value, float weight) {
  constexpr double kMagnitudeMin = 0x1p-100;
  const double product = static_cast<double>(value) * static_cast<double>(weight);
  return std::fabs(product) < kMagnitudeMin ? 0.0 : product;
}

}  // namespace sheaf
