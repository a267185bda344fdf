// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A sequence of shares that is even however long it is. Nothing is random about it, so that who
// asks for the same member has the same share.
#pragma once

#include <cmath>
#include <cstddef>
#include <numbers>

namespace sheaf {

// The i-th of a sequence in [0, 1) whose members, any number of them from any one on, are spread
// evenly. Source: Weyl 1916, multiples of the golden ratio.
inline double GoldenShare(size_t i) {
  const double place = (static_cast<double>(i) + 0.5) / std::numbers::phi;
  return place - std::floor(place);
}

}  // namespace sheaf
