// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/mean_interval.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"

namespace sheaf {

double StudentQuantile975(double degrees_of_freedom) {
  // The expansion of Cornish and Fisher about the normal quantile.
  constexpr double z = 1.959963984540054;
  constexpr double z2 = z * z;
  const double n = std::max(degrees_of_freedom, 3.0);
  const double g1 = z * (z2 + 1) / 4;
  const double g2 = z * ((5 * z2 + 16) * z2 + 3) / 96;
  const double g3 = z * (((3 * z2 + 19) * z2 + 17) * z2 - 15) / 384;
  return z + (g1 + (g2 + g3 / n) / n) / n;
}

MeanInterval MeanIntervalOf(const FilmTile& sums, const std::array<double, 3>& weights) {
  const uint32_t count = sums.replicate_count();
  SHEAF_CHECK(count >= 2);
  MeanInterval interval;
  double variance_sum = 0, square_sum = 0, share_sum = 0;
  for (size_t p = 0; p < sums.plane_size(); ++p) {
    double mean = 0;
    std::array<double, kReplicateCount> of_replicate{};
    for (uint32_t r = 0; r < count; ++r) {
      for (size_t i = 0; i < 3; ++i) {
        of_replicate[r] += weights[i] * static_cast<double>(sums.replicate(r, i)[p]) /
                           static_cast<double>(sums.replicate(r, 3)[p]);
      }
      mean += of_replicate[r] / count;
    }
    double squares = 0, largest = 0;
    for (uint32_t r = 0; r < count; ++r) {
      const double square = (of_replicate[r] - mean) * (of_replicate[r] - mean);
      squares += square;
      largest = std::max(largest, square);
    }
    const double variance = squares / (count * (count - 1.0));
    interval.mean += mean;
    variance_sum += variance;
    square_sum += variance * variance;
    if (squares > 0) share_sum += variance * largest / squares;
  }
  const auto pixels = static_cast<double>(sums.plane_size());
  interval.mean /= pixels;
  interval.standard_error = std::sqrt(variance_sum) / pixels;
  if (variance_sum == 0) return interval;
  interval.degrees_of_freedom = (count - 1) * variance_sum * variance_sum / square_sum;
  interval.half_width = StudentQuantile975(interval.degrees_of_freedom) * interval.standard_error;
  interval.one_replicate_share = share_sum / variance_sum;
  interval.is_reliable = interval.one_replicate_share <= kOneReplicateMax;
  return interval;
}

}  // namespace sheaf
