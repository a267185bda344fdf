// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DoubleFloat: a number as the unevaluated sum of two floats, 48 bits wide and able to travel in
// two float32 channels of an image.
#pragma once

namespace sheaf {

// value = hi + lo with hi the float nearest to the value; so |lo| is at most half an ulp of hi, and
// equal values have equal bits. Holds what is representable in 48 bits and at most FLT_MAX in size.
struct DoubleFloat {
  float hi = 0, lo = 0;

  // Rounds to 48 bits. Requires: |value| is finite and rounds to a finite float.
  static DoubleFloat Make(double value) {
    const float head = static_cast<float>(value);
    return {head, static_cast<float>(value - static_cast<double>(head))};
  }
  // Exact: 48 bits and any gap between hi and lo that Make leaves fit in a double.
  double Value() const { return static_cast<double>(hi) + static_cast<double>(lo); }

  friend bool operator==(const DoubleFloat&, const DoubleFloat&) = default;
};

// The sum, rounded to double and then to 48 bits: commutative, not associative.
inline DoubleFloat Add(DoubleFloat a, DoubleFloat b) {
  return DoubleFloat::Make(a.Value() + b.Value());
}

}  // namespace sheaf
