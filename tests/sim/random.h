// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Random: numbers that follow from a seed, on every machine alike (the distributions of the
// standard library differ between implementations).
#pragma once

#include <cstdint>

#include "absl/time/time.h"
#include "common/math/mix_bits.h"

namespace sheaf::sim {

class Random {
 public:
  explicit Random(uint64_t seed) : state_(MixBits(seed + kIncrement)) {}
  // A stream of its own for each number: what one consumes does not change another.
  Random Stream(uint64_t number) const { return Random(state_ + MixBits(number + 1)); }

  uint64_t Bits() { return MixBits(state_ += kIncrement); }
  // From 0 to count - 1. Requires: count at least 1.
  uint64_t Below(uint64_t count) { return Bits() % count; }
  // From low to high, both included.
  int64_t Between(int64_t low, int64_t high) {
    return low + static_cast<int64_t>(Below(static_cast<uint64_t>(high - low + 1)));
  }
  // In [0, 1).
  double Unit() { return static_cast<double>(Bits() >> 11) * 0x1p-53; }
  bool Chance(double probability) { return Unit() < probability; }
  absl::Duration Between(absl::Duration low, absl::Duration high) {
    return absl::Nanoseconds(
        Between(absl::ToInt64Nanoseconds(low), absl::ToInt64Nanoseconds(high)));
  }

 private:
  static constexpr uint64_t kIncrement = 0x9e3779b97f4a7c15u;  // SplitMix64's.
  uint64_t state_;
};

}  // namespace sheaf::sim
