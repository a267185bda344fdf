// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lanes: eight floats at once; Floats4: four. The vector types of GCC and Clang: element-wise IEEE
// 754 operations, in as few instructions as the target allows.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace sheaf {

inline constexpr size_t kLaneCount = 8;

using Floats4 = float __attribute__((vector_size(16)));
using Ints4 = int32_t __attribute__((vector_size(16)));
using Words4 = uint32_t __attribute__((vector_size(16)));

using Lanes = float __attribute__((vector_size(kLaneCount * sizeof(float))));
// Results of comparisons: -1 if true, else 0.
using MaskLanes = int32_t __attribute__((vector_size(kLaneCount * sizeof(int32_t))));

template <typename Result, typename Value>
inline Result LoadLanes(const Value (&values)[kLaneCount]) {
  Result lanes;
  static_assert(sizeof(lanes) == sizeof(values));
  std::memcpy(&lanes, values, sizeof(lanes));
  return lanes;
}
inline Lanes Sqrt(Lanes a) {
  Lanes root;
  for (size_t i = 0; i < kLaneCount; ++i) root[i] = std::sqrt(a[i]);
  return root;
}
// The first argument if the other is NaN.
inline Lanes Max(Lanes a, Lanes b) { return a < b ? b : a; }
inline Lanes Min(Lanes a, Lanes b) { return b < a ? b : a; }
inline Lanes Abs(Lanes a) { return Max(a, -a); }
inline Lanes All(float value) { return Lanes{} + value; }
inline float Sum(Lanes a) {
  static_assert(kLaneCount == 8);
  return ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]));
}

}  // namespace sheaf
