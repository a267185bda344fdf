// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Common formulas of sums, statistics and random choices in single precision. docs/hard-cases.md
// says for each row where the formula breaks down; tests record their results beside the expected
// values (hard_case.h).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace sheaf::naive {

// C2: the weighted mean.
inline float WeightedMean(const std::vector<float>& values, const std::vector<float>& weights) {
  float sum = 0, weight = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    sum += weights[i] * values[i];
    weight += weights[i];
  }
  return sum / weight;
}

// C3: the mean of count equal values by a running sum; once the sum stalls, it never changes again.
inline float MeanOfEqual(float value, uint64_t count) {
  float sum = 0;
  for (uint64_t i = 0; i < count && sum + value != sum; ++i) sum += value;
  return sum / static_cast<float>(count);
}

// C4: the value after conversion to a 16-bit float, whose maximum is 65504.
inline float AsHalf(float value) {
  constexpr float kLargest = 65504, kHalfStep = 16;
  if (std::fabs(value) < kLargest + kHalfStep) return value;
  return std::copysign(std::numeric_limits<float>::infinity(), value);
}

// C6, A5: a sum in the given order.
inline float Sum(const std::vector<float>& values) {
  float sum = 0;
  for (const float v : values) sum += v;
  return sum;
}

// R1: 32 random bits as a number in [0, 1).
inline float UnitFloat(uint32_t bits) { return static_cast<float>(bits) * 0x1p-32f; }

// R4: the first entry whose running sum is not below the fraction u of the whole.
inline size_t Choose(const std::vector<double>& weights, float u) {
  float sum = 0;
  for (const double w : weights) sum += static_cast<float>(w);
  float running = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    running += static_cast<float>(weights[i]);
    if (u * sum <= running) return i;
  }
  return weights.size();
}

// R5: the remainder of u for a position after that many choices between two halves.
inline float AfterHalving(float u, int choices) {
  for (int i = 0; i < choices; ++i) u = u < 0.5f ? 2 * u : 2 * u - 1;
  return u;
}

// R6: the furnace of emission 1 with a maximum number of bounces, without Russian roulette.
inline float FurnaceInBounces(float reflectance, int bounces) {
  float sum = 0, throughput = 1;
  for (int i = 0; i <= bounces; ++i) {
    sum += throughput;
    throughput *= reflectance;
  }
  return sum;
}

// R7: the power heuristic by squares.
inline float PowerHeuristic(float f, float g) { return f * f / (f * f + g * g); }

// R9: the standard error of a mean by E[x^2] - E[x]^2.
inline float StandardError(const std::vector<float>& values) {
  float sum = 0, squares = 0;
  for (const float v : values) {
    sum += v;
    squares += v * v;
  }
  const auto n = static_cast<float>(values.size());
  return std::sqrt((squares / n - sum / n * (sum / n)) / (n - 1));
}

}  // namespace sheaf::naive
