// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Discrepancies of point sets in [0, 1)^D: the root mean square, over boxes, of the difference
// between a box's share of the points and its volume. Both take O(N^2 D). Thread-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

namespace sheaf::render {

template <size_t D>
using PointSet = std::vector<std::array<double, D>>;

// The square of the L2-star discrepancy, over boxes with a corner at 0. Requires: a point.
// Source: Warnock 1972, "Computational investigations of low-discrepancy point sets".
template <size_t D>
double L2StarSquared(const PointSet<D>& points) {
  const auto count = static_cast<double>(points.size());
  double single = 0, pairs = 0;
  for (const auto& p : points) {
    double product = 1;
    for (const double x : p) product *= 1 - x * x;
    single += product;
    for (const auto& q : points) {
      double both = 1;
      for (size_t k = 0; k < D; ++k) both *= 1 - std::max(p[k], q[k]);
      pairs += both;
    }
  }
  return std::pow(3.0, -static_cast<double>(D)) -
         std::pow(2.0, 1 - static_cast<double>(D)) * single / count + pairs / (count * count);
}

// The mean of L2StarSquared over sets of independent uniform points.
template <size_t D>
double IndependentL2StarSquared(double count) {
  const auto d = static_cast<double>(D);
  return (std::pow(2.0, -d) - std::pow(3.0, -d)) / count;
}

// The square of the wrap-around discrepancy, over all boxes of the torus: no corner is preferred.
// Source: Hickernell 1998, "Lattice rules: how well do they measure up?".
template <size_t D>
double WrapAroundSquared(const PointSet<D>& points) {
  const auto count = static_cast<double>(points.size());
  double pairs = 0;
  for (const auto& p : points) {
    for (const auto& q : points) {
      double both = 1;
      for (size_t k = 0; k < D; ++k) {
        const double apart = std::fabs(p[k] - q[k]);
        both *= 1.5 - apart * (1 - apart);
      }
      pairs += both;
    }
  }
  return pairs / (count * count) - std::pow(4.0 / 3, static_cast<double>(D));
}

// The mean of WrapAroundSquared over sets of independent uniform points.
template <size_t D>
double IndependentWrapAroundSquared(double count) {
  const auto d = static_cast<double>(D);
  return (std::pow(1.5, d) - std::pow(4.0 / 3, d)) / count;
}

}  // namespace sheaf::render
