// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/pixel_replicates.h"

#include <cmath>
#include <cstdint>

namespace sheaf {

PixelReplicates::PixelReplicates(const FilmTile& sums, size_t p) {
  for (uint32_t slot = 0; slot < sums.replicate_count(); ++slot) {
    Sums& replicate = replicates_[count_];
    bool has_samples = false;
    for (size_t i = 0; i < replicate.size(); ++i) {
      replicate[i] = sums.replicate(slot, i)[p];
      has_samples |= replicate[i] != 0;
    }
    if (has_samples) ++count_;
  }
}

// color_of: a replicate's sum of the quantity whose standard error is computed.
template <typename ColorOf>
double PixelReplicates::SpreadOf(const ColorOf& color_of) const {
  double sum = 0, weight = 0;
  for (size_t r = 0; r < count_; ++r) {
    sum += color_of(replicates_[r]);
    weight += double{replicates_[r][3]};
  }
  if (count_ < 2 || weight == 0) return 0;
  const double mean = sum / weight;
  double squares = 0;
  for (size_t r = 0; r < count_; ++r) {
    const double residual = color_of(replicates_[r]) - mean * double{replicates_[r][3]};
    squares += residual * residual;
  }
  const auto count = static_cast<double>(count_);
  return std::sqrt(squares * count / (count - 1)) / std::fabs(weight);
}

double PixelReplicates::StandardError(size_t component) const {
  return SpreadOf([component](const Sums& sums) { return double{sums[component]}; });
}

double PixelReplicates::StandardError(const std::array<double, 3>& weights) const {
  return SpreadOf([&weights](const Sums& sums) {
    double sum = 0;
    for (size_t i = 0; i < 3; ++i) sum += weights[i] * double{sums[i]};
    return sum;
  });
}

double StandardErrorOfDifference(const FilmTile& sums, size_t left, size_t right,
                                 const std::array<double, 3>& weights) {
  const std::array<size_t, 2> pixels{left, right};
  const auto weight_of = [&](uint32_t slot, size_t p) {
    return double{sums.replicate(slot, 3)[p]};
  };
  const auto color_of = [&](uint32_t slot, size_t p) {
    double sum = 0;
    for (size_t i = 0; i < 3; ++i) sum += weights[i] * double{sums.replicate(slot, i)[p]};
    return sum;
  };
  std::array<double, 2> color{}, weight{};
  for (uint32_t slot = 0; slot < sums.replicate_count(); ++slot) {
    for (size_t i = 0; i < 2; ++i) {
      color[i] += color_of(slot, pixels[i]);
      weight[i] += weight_of(slot, pixels[i]);
    }
  }
  if (weight[0] == 0 || weight[1] == 0) return 0;
  double squares = 0, count = 0;
  for (uint32_t slot = 0; slot < sums.replicate_count(); ++slot) {
    std::array<double, 2> residual;
    bool has_samples = false;
    for (size_t i = 0; i < 2; ++i) {
      const double w = weight_of(slot, pixels[i]), c = color_of(slot, pixels[i]);
      residual[i] = (c - color[i] / weight[i] * w) / weight[i];
      has_samples |= w != 0 || c != 0;
    }
    if (!has_samples) continue;
    ++count;
    squares += (residual[0] - residual[1]) * (residual[0] - residual[1]);
  }
  return count < 2 ? 0 : std::sqrt(squares * count / (count - 1));
}

}  // namespace sheaf
