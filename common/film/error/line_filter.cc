// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/line_filter.h"

#include <cmath>

#include "common/math/elementary.h"

namespace sheaf {

LineKernel GaussKernel(double deviation, int32_t radius, double total) {
  std::vector<double> values;
  double sum = 0;
  for (int32_t x = 0; x <= radius; ++x) {
    const double value = Exp(-0.5 * x * x / (deviation * deviation));
    if (value < 0x1p-26) break;
    values.push_back(value);
    sum += x == 0 ? value : 2 * value;
  }
  LineKernel kernel;
  for (const double value : values) {
    kernel.weights.push_back(static_cast<float>(value * total / sum));
  }
  return kernel;
}

LineKernel BalancedKernel(const std::vector<double>& values, bool odd) {
  double positive = 0, negative = 0;
  for (size_t x = 0; x < values.size(); ++x) {
    const double value = x == 0 || odd ? values[x] : 2 * values[x];
    (value > 0 ? positive : negative) += std::fabs(value);
  }
  if (odd) positive = negative = positive + negative;
  LineKernel kernel;
  for (const double value : values) {
    kernel.weights.push_back(static_cast<float>(value / (value > 0 ? positive : negative)));
  }
  return kernel;
}

}  // namespace sheaf
