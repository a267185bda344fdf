// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampling/discrete_distribution.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/base/check.h"

namespace sheaf::render {

DiscreteDistribution::DiscreteDistribution(const std::vector<double>& weights) {
  SHEAF_CHECK(weights.size() < std::numeric_limits<uint32_t>::max());
  double sum = 0;
  size_t last_positive = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    SHEAF_CHECK(weights[i] >= 0 && std::isfinite(weights[i]));
    sum += weights[i];
    if (weights[i] > 0) last_positive = i;
  }
  if (!(sum > 0)) return;
  SHEAF_CHECK(std::isfinite(sum));
  cdf_.resize(weights.size() + 1);
  double running = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    cdf_[i] = std::min(running / sum, 1.0);
    running += weights[i];
  }
  // Gives the rounding remainder to the last entry of positive weight.
  for (size_t i = last_positive + 1; i <= weights.size(); ++i) cdf_[i] = 1;
  guide_.resize(weights.size());
  const double step = 1.0 / static_cast<double>(guide_.size());
  size_t index = 0;
  for (size_t k = 0; k < guide_.size(); ++k) {
    while (cdf_[index + 1] <= static_cast<double>(k) * step) ++index;
    guide_[k] = static_cast<uint32_t>(index);
  }
}

size_t DiscreteDistribution::Sample(double u) const {
  const size_t k =
      std::min(static_cast<size_t>(u * static_cast<double>(guide_.size())), guide_.size() - 1);
  size_t index = guide_[k];
  // The product above may round up into the next cell of the guide.
  while (index > 0 && cdf_[index] > u) --index;
  while (cdf_[index + 1] <= u) ++index;
  return index;
}

}  // namespace sheaf::render
