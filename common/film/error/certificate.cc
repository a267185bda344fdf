// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/certificate.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "common/base/check.h"

namespace sheaf {
namespace {

// Stakes are 2^kLeastStake .. 2^(kLeastStake + kStakeCount - 1), each with the same share.
constexpr int kLeastStake = -40, kStakeCount = 48;
constexpr int kBisectionSteps = 60;
// The lower bound of the image's mean takes this share of its miss probability.
constexpr double kMeanShare = 0.1;
// Replicates that the variance and the product are from: those of even and of odd number.
constexpr uint32_t kHalf = kReplicateCount / 2, kQuarter = kReplicateCount / 4;
// Sums of replicates are float32, so v and q have relative errors of a few 2^-22 of the squares.
constexpr double kRounding = 1e-6;

double StakeAt(int i) { return std::ldexp(1.0, kLeastStake + i); }

// log of the mean over the stakes of exp(gain), where stakes that are out of range count as 0.
double LogOfMean(const std::array<double, kStakeCount>& gains) {
  const double largest = *std::max_element(gains.begin(), gains.end());
  if (!std::isfinite(largest)) return largest;
  double sum = 0;
  for (const double gain : gains) sum += std::exp(gain - largest);
  return largest + std::log(sum / kStakeCount);
}

// 6 / (pi k)^2 sums to 1 over k = 1, 2 ...
double ShareOf(double k) {
  constexpr double kPi = 3.14159265358979324;
  return 6 / (kPi * kPi * k * k);
}

// The number of a certified stop in their order, from 1; 0 for other counts.
int StopNumber(uint64_t samples) {
  if (samples == 0 || samples % kReplicateCount != 0) return 0;
  const uint64_t points = samples / kReplicateCount;
  const auto log = static_cast<int>(std::bit_width(points)) - 1;
  if (std::has_single_bit(points)) return log == 0 ? 1 : 2 * log;
  return points == uint64_t{3} << (log - 1) ? 2 * log + 1 : 0;
}

}  // namespace

bool IsCertifiedStop(uint64_t samples) { return StopNumber(samples) != 0; }

uint64_t NextCertifiedStop(uint64_t samples) {
  uint64_t next = (samples / kReplicateCount + 1) * kReplicateCount;
  while (!IsCertifiedStop(next)) {
    const uint64_t points = next / kReplicateCount;
    const uint64_t octave = std::bit_floor(points);
    next = kReplicateCount * (points < 3 * octave / 2 ? 3 * octave / 2 : 2 * octave);
  }
  return next;
}

double MissProbabilityAt(uint64_t samples) {
  SHEAF_CHECK(samples > 0 && samples % kReplicateCount == 0);
  const auto points = static_cast<double>(samples / kReplicateCount);
  const int stop = StopNumber(samples);
  return kCertificateMissProbability / 2 *
         (ShareOf(points) + (stop == 0 ? 0 : ShareOf(static_cast<double>(stop))));
}

double UpperBoundOfMean(std::span<const double> values, double most, double miss_probability) {
  SHEAF_CHECK(!values.empty() && most > 0 && miss_probability > 0);
  const auto count = static_cast<double>(values.size());
  std::array<double, kStakeCount> won{};  // sum log(1 - t x).
  for (int i = 0; i < kStakeCount; ++i) {
    const double stake = StakeAt(i);
    if (stake * most >= 1) {
      won[static_cast<size_t>(i)] = -std::numeric_limits<double>::infinity();
      continue;
    }
    double sum = 0;
    for (const double value : values) sum += std::log1p(-stake * value);
    won[static_cast<size_t>(i)] = sum;
  }
  const auto excluded = [&](double mean) {
    std::array<double, kStakeCount> gains = won;
    for (int i = 0; i < kStakeCount; ++i) {
      double& gain = gains[static_cast<size_t>(i)];
      if (std::isfinite(gain)) gain -= count * std::log1p(-StakeAt(i) * mean);
    }
    return LogOfMean(gains) >= -std::log(miss_probability);
  };
  double low = 0, high = most;
  if (!excluded(high)) return most;
  for (int i = 0; i < kBisectionSteps; ++i) {
    const double middle = (low + high) / 2;
    (excluded(middle) ? high : low) = middle;
  }
  return high;
}

double LowerBoundOfMean(std::span<const double> values, double scale, double miss_probability) {
  SHEAF_CHECK(!values.empty() && scale > 0 && miss_probability > 0);
  const auto count = static_cast<double>(values.size());
  std::array<double, kStakeCount> won{};  // sum log(1 + t x).
  double largest = 0;
  for (const double value : values) largest = std::max(largest, value);
  for (int i = 0; i < kStakeCount; ++i) {
    const double stake = StakeAt(i) / scale;
    double sum = 0;
    for (const double value : values) sum += std::log1p(stake * value);
    won[static_cast<size_t>(i)] = sum;
  }
  const auto excluded = [&](double mean) {
    std::array<double, kStakeCount> gains = won;
    for (int i = 0; i < kStakeCount; ++i) {
      gains[static_cast<size_t>(i)] -= count * std::log1p(StakeAt(i) / scale * mean);
    }
    return LogOfMean(gains) >= -std::log(miss_probability);
  };
  double low = 0, high = largest;
  if (!excluded(low)) return 0;
  for (int i = 0; i < kBisectionSteps; ++i) {
    const double middle = (low + high) / 2;
    (excluded(middle) ? low : high) = middle;
  }
  return low;
}

void CertificatePlanes::TakePixel(const FilmTile& sums, size_t from, size_t to) {
  std::array<float, kPlaneCount>& pixel = pixels_[to];
  pixel = {};
  samples_[to] = kUnusable;
  const float weight = sums.replicate(0, 3)[from];
  if (!(weight > 0) || sums.channel(FilmChannel::kNonFiniteCount)[from] != 0) return;
  std::array<double, kReplicateCount> means{};
  double sum_of_means = 0;
  for (size_t c = 0; c < 3; ++c) {
    double even = 0;
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      if (sums.replicate(r, 3)[from] != weight) return;
      const float value = sums.replicate(r, c)[from];
      means[r] = double{value} / double{weight};
      if (!(value >= 0) || means[r] > most_[c] * (1 + kRounding)) return;
      sum_of_means += means[r];
      if (r % 2 == 0) even += means[r] / kHalf;
    }
    double squares = 0, first = 0, second = 0;
    for (uint32_t r = 0; r < kReplicateCount; r += 2) {
      squares += (means[r] - even) * (means[r] - even);
      (r % 4 == 0 ? first : second) += means[r + 1] / kQuarter;
    }
    pixel[c] = static_cast<float>(squares / (kHalf - 1) / kReplicateCount);
    pixel[3 + c] = static_cast<float>(first * second);
  }
  pixel[kMean] = static_cast<float>(sum_of_means / (3 * kReplicateCount));
  samples_[to] = static_cast<uint32_t>(weight) * kReplicateCount;
}

void CertificatePlanes::TakeTile(const FilmTile& sums) {
  const PixelRect tile = sums.rect();
  SHEAF_CHECK(tile.x0 >= window_.x0 && tile.y0 >= window_.y0 && tile.x1 <= window_.x1 &&
              tile.y1 <= window_.y1);
  pixels_.resize(static_cast<size_t>(window_.PixelCount()));
  samples_.resize(pixels_.size());
  size_t from = 0;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    size_t to = window_.IndexOf(tile.x0, y);
    for (int32_t x = tile.x0; x < tile.x1; ++x, ++from, ++to) {
      if (sums.replicate_count() == kReplicateCount) {
        TakePixel(sums, from, to);
      } else {
        samples_[to] = kUnusable;
      }
    }
  }
}

CertificatePlanes::Result CertificatePlanes::CertifiedError(uint64_t samples) const {
  if (samples == 0 || samples % kReplicateCount != 0) {
    return {.why_not = "the number of samples is not a multiple of 16"};
  }
  if (pixels_.empty()) return {.why_not = "there are no samples"};
  std::vector<double> values;
  values.reserve(pixels_.size());
  for (size_t p = 0; p < pixels_.size(); ++p) {
    if (samples_[p] == kUnusable)
      return {.why_not = "a pixel has samples that are invalid, negative or above their maximum"};
    if (samples_[p] != samples) return {.why_not = "pixels have different numbers of samples"};
    values.push_back(double{pixels_[p][kMean]});
  }
  const double miss = MissProbabilityAt(samples);
  const double largest = std::max({most_[0], most_[1], most_[2]});
  const double mean = LowerBoundOfMean(values, largest, kMeanShare * miss);
  const double floor_square = 0.01 * mean * mean * (1 - kRounding);
  if (!(floor_square > 0)) return {.why_not = "the image may be black"};
  double most = 0;  // v is largest if half of the replicates are 0 and half of them `most_`.
  for (const double m : most_) {
    most += m * m * kHalf / (4 * (kHalf - 1) * kReplicateCount) / (3 * floor_square);
  }
  most *= 1 + kRounding;
  for (size_t p = 0; p < pixels_.size(); ++p) {
    double value = 0;
    for (size_t c = 0; c < 3; ++c) {
      value += double{pixels_[p][c]} / (double{pixels_[p][3 + c]} + floor_square) / 3;
    }
    values[p] = std::min(value, most);
  }
  return {.relative_mse_upper =
              UpperBoundOfMean(values, most, (1 - kMeanShare) * miss) * (1 + kRounding)};
}

}  // namespace sheaf
