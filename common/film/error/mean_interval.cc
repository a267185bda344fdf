// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/mean_interval.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"

namespace sheaf {

double StudentQuantile975(double degrees_of_freedom) {
  // The Cornish-Fisher expansion about the normal quantile.
  constexpr double z = 1.959963984540054;
  constexpr double z2 = z * z;
  const double n = std::max(degrees_of_freedom, 3.0);
  const double g1 = z * (z2 + 1) / 4;
  const double g2 = z * ((5 * z2 + 16) * z2 + 3) / 96;
  const double g3 = z * (((3 * z2 + 19) * z2 + 17) * z2 - 15) / 384;
  return z + (g1 + (g2 + g3 / n) / n) / n;
}

namespace {

struct PixelSpread {
  double mean = 0;
  double squares = 0,
         largest = 0;  // The replicates' squared deviations: their sum and the largest.
};

PixelSpread SpreadOf(const FilmTile& sums, size_t p, const std::array<double, 3>& weights) {
  const uint32_t count = sums.replicate_count();
  std::array<double, kReplicateCount> colors{};
  double color = 0, weight = 0;
  for (uint32_t r = 0; r < count; ++r) {
    for (size_t i = 0; i < 3; ++i) {
      colors[r] += weights[i] * static_cast<double>(sums.replicate(r, i)[p]);
    }
    color += colors[r];
    weight += static_cast<double>(sums.replicate(r, 3)[p]);
  }
  PixelSpread spread;
  if (weight == 0) return spread;
  spread.mean = color / weight;
  for (uint32_t r = 0; r < count; ++r) {
    const double residual = colors[r] - spread.mean * static_cast<double>(sums.replicate(r, 3)[p]);
    const double deviation = residual * count / weight;
    spread.squares += deviation * deviation;
    spread.largest = std::max(spread.largest, deviation * deviation);
  }
  return spread;
}

}  // namespace

MeanInterval MeanIntervalOf(const FilmTile& sums, const PixelRect& rect,
                            const std::array<double, 3>& weights) {
  const uint32_t count = sums.replicate_count();
  const PixelRect& all = sums.rect();
  SHEAF_CHECK(count >= 2 && rect.x0 >= all.x0 && rect.y0 >= all.y0 && rect.x1 <= all.x1 &&
              rect.y1 <= all.y1);
  MeanInterval interval;
  double variance_sum = 0, square_sum = 0, fraction_sum = 0;
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = rect.x0; x < rect.x1; ++x) {
      const size_t p = all.IndexOf(x, y);
      const PixelSpread spread = SpreadOf(sums, p, weights);
      const double variance = spread.squares / (count * (count - 1.0));
      interval.mean += spread.mean;
      variance_sum += variance;
      square_sum += variance * variance;
      if (spread.squares > 0) fraction_sum += variance * spread.largest / spread.squares;
    }
  }
  const auto pixels = static_cast<double>(rect.PixelCount());
  interval.mean /= pixels;
  interval.standard_error = std::sqrt(variance_sum) / pixels;
  if (variance_sum == 0) return interval;
  interval.degrees_of_freedom = (count - 1) * variance_sum * variance_sum / square_sum;
  interval.half_width = StudentQuantile975(interval.degrees_of_freedom) * interval.standard_error;
  interval.one_replicate_fraction = fraction_sum / variance_sum;
  interval.is_reliable = interval.one_replicate_fraction <= kOneReplicateMax;
  return interval;
}

bool IsSumReliable(const MeanInterval& a, const MeanInterval& b) {
  const double variance_a = a.standard_error * a.standard_error,
               variance_b = b.standard_error * b.standard_error;
  return variance_a * a.one_replicate_fraction + variance_b * b.one_replicate_fraction <=
         kOneReplicateMax * (variance_a + variance_b);
}

}  // namespace sheaf
