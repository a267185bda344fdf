// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Exact: sums and products of doubles without rounding, for oracles of geometric predicates. A
// number is stored as a sum of doubles whose bits do not overlap. Source: Shewchuk 1997, "Adaptive
// Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates", sec. 2. Requires: no
// product of parts leaves the range of double.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "common/math/vec.h"

namespace sheaf {

class Exact {
 public:
  Exact() = default;
  explicit Exact(double value) { Grow(value); }

  friend Exact operator+(Exact a, const Exact& b) {
    for (const double part : b.parts_) a.Grow(part);
    return a;
  }
  friend Exact operator-(Exact a, const Exact& b) {
    for (const double part : b.parts_) a.Grow(-part);
    return a;
  }
  friend Exact operator*(const Exact& a, const Exact& b) {
    Exact product;
    for (const double x : a.parts_) {
      for (const double y : b.parts_) {
        const double rounded = x * y;
        product.Grow(std::fma(x, y, -rounded));
        product.Grow(rounded);
      }
    }
    return product;
  }
  // The largest part is greater than the sum of all others.
  int Sign() const { return parts_.empty() ? 0 : (parts_.back() > 0 ? 1 : -1); }
  long double Rounded() const {
    long double sum = 0;
    for (const double part : parts_) sum += static_cast<long double>(part);
    return sum;
  }

 private:
  void Grow(double value) {
    size_t kept = 0;
    for (const double part : parts_) {
      const double sum = value + part;
      const double back = sum - value;
      const double rest = (value - (sum - back)) + (part - back);
      if (rest != 0) parts_[kept++] = rest;
      value = sum;
    }
    parts_.resize(kept);
    if (value != 0) parts_.push_back(value);
  }

  std::vector<double> parts_;  // In ascending magnitude; none is 0.
};

struct ExactVector {
  Exact x, y, z;
  explicit ExactVector(Vec3f v) : x(v.x), y(v.y), z(v.z) {}
  ExactVector(Exact vx, Exact vy, Exact vz) : x(vx), y(vy), z(vz) {}
  friend ExactVector operator-(const ExactVector& a, const ExactVector& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
};
inline Exact Dot(const ExactVector& a, const ExactVector& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline ExactVector Cross(const ExactVector& a, const ExactVector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace sheaf
