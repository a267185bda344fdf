// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A deterministic sequence of numbers in [0, 1) that is evenly spread at any length, so that all
// who evaluate the same member get the same value.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>

namespace sheaf {

// The i-th member. Any number of consecutive members, from any start, are evenly spread. Source:
// Weyl 1916, multiples of the golden ratio.
inline double GoldenFraction(size_t i) {
  const double place = (static_cast<double>(i) + 0.5) / std::numbers::phi;
  return place - std::floor(place);
}

}  // namespace sheaf
