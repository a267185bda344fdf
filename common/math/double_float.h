// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DoubleFloat: a number as the unevaluated sum of two floats, 48 bits wide, which can be stored in
// two float32 channels of an image.
#pragma once

namespace sheaf {

// value = hi + lo with hi the float nearest to the value (ties to even), so equal values have equal
// bits. Holds numbers that fit in two adjoining 24-bit significands and are at most FLT_MAX in
// magnitude.
struct DoubleFloat {
  float hi = 0, lo = 0;

  // The nearest such number, as a double. Requires: value is finite and rounds to a finite float.
  static double Round(double value) {
    const float head = static_cast<float>(value);
    return static_cast<double>(head) + static_cast<double>(static_cast<float>(value - head));
  }
  // Rounds, then splits. Rounding the tail may produce a tie, where the nearest float is the even
  // one; so the head is taken from the rounded value.
  static DoubleFloat Make(double value) {
    const double rounded = Round(value);
    const float hi = static_cast<float>(rounded);
    return {hi, static_cast<float>(rounded - hi)};
  }
  // Exact: any result of Make fits in a double.
  double Value() const { return static_cast<double>(hi) + static_cast<double>(lo); }

  friend bool operator==(const DoubleFloat&, const DoubleFloat&) = default;
};

// The sum, rounded to double and then as in Make: commutative, not associative.
inline DoubleFloat Add(DoubleFloat a, DoubleFloat b) {
  return DoubleFloat::Make(a.Value() + b.Value());
}

}  // namespace sheaf
