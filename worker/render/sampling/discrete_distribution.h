// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DiscreteDistribution: samples an index in proportion to its weight by inverting the cumulative
// sums. Unlike an alias table this keeps the order of u, and with it the stratification of
// low-discrepancy points. A guide table makes the expected cost of a lookup constant. Source: Chen
// and Asau 1974, "On Generating Random Variates from an Empirical Distribution".
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::render {

// Extends u, a multiple of 2^-24, by 29 bits that are a hash of salt, so that a choice among more
// items than 2^24 steps can separate (a million lights, a dark map with one bright texel) stays
// unbiased. Returns: in [0, 1).
inline double ExtendBits(float u, uint64_t salt) {
  uint64_t v = (salt ^ std::bit_cast<uint32_t>(u)) * 0x9e3779b97f4a7c15u;
  v = (v ^ (v >> 32)) * 0xd6e8feb86659fd93u;
  v ^= v >> 32;
  return static_cast<double>(u) + static_cast<double>(v >> 35) * 0x1p-53;
}
// Makes a salt from a pair of numbers in [0, 1).
inline uint64_t SaltOf(Vec2f u) {
  return (uint64_t{std::bit_cast<uint32_t>(u.x)} << 32) | std::bit_cast<uint32_t>(u.y);
}

class DiscreteDistribution {
 public:
  DiscreteDistribution() = default;
  // Requires: weights are finite and nonnegative. If their sum is 0, the distribution is empty().
  explicit DiscreteDistribution(const std::vector<double>& weights);

  bool empty() const { return cdf_.empty(); }
  // Returns the index whose interval contains u; never one of weight 0. Requires: !empty(), u in
  // [0, 1).
  size_t Sample(double u) const;
  // Begin of the index's interval.
  double Begin(size_t index) const { return cdf_[index]; }
  // Length of the index's interval, which is the probability with which Sample returns it.
  double Probability(size_t index) const { return cdf_[index + 1] - cdf_[index]; }
  size_t size_bytes() const {
    return cdf_.size() * sizeof(double) + guide_.size() * sizeof(uint32_t);
  }

 private:
  std::vector<double> cdf_;      // size + 1 entries, from 0 to 1.
  std::vector<uint32_t> guide_;  // guide_[k]: the index whose interval contains k / guide_.size().
};

}  // namespace sheaf::render
