// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The neighbors of a float, for error-bounded ray origins and intervals.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "common/math/lanes.h"

namespace sheaf {

// The least float greater than v. Infinity and NaN are returned unchanged; -0 and 0 give the first
// positive subnormal.
inline float NextUp(float v) {
  if (std::isnan(v) || (std::isinf(v) && v > 0)) return v;
  if (v == 0) return std::bit_cast<float>(uint32_t{1});
  const uint32_t bits = std::bit_cast<uint32_t>(v);
  return std::bit_cast<float>(v > 0 ? bits + 1 : bits - 1);
}
// The greatest float less than v.
inline float NextDown(float v) { return -NextUp(-v); }

// The neighbor of each v in the direction of the sign of its `side`; v itself if side is 0. The
// same as NextUp and NextDown, but without branches, as signs are hard to predict.
// Requires: v is finite.
inline Floats4 NextTowards(Floats4 v, Floats4 side) {
  // Unsigned, so sums wrap around; the result for -0 is computed too, but not used.
  const Ints4 negative = std::bit_cast<Ints4>(v) >> 31;
  const Ints4 step = (side < 0) - (side > 0);
  const Words4 moved =
      std::bit_cast<Words4>(v) + std::bit_cast<Words4>((step ^ negative) - negative);
  const Words4 beside_zero = side < 0 ? Words4{} + 0x80000001u : Words4{} + 1u;
  return std::bit_cast<Floats4>((v == 0) & (step != 0) ? beside_zero : moved);
}

inline double NextUp(double v) {
  if (std::isnan(v) || (std::isinf(v) && v > 0)) return v;
  if (v == 0) return std::bit_cast<double>(uint64_t{1});
  const uint64_t bits = std::bit_cast<uint64_t>(v);
  return std::bit_cast<double>(v > 0 ? bits + 1 : bits - 1);
}
inline double NextDown(double v) { return -NextUp(-v); }

}  // namespace sheaf
