// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Products and sums that stay accurate under cancellation. std::fma rounds once by definition, so
// these are as reproducible as + and *.
#pragma once

#include <cmath>

#include "common/math/vec.h"

namespace sheaf {

// a b - c d with an error of at most 1.5 ulp of the result; the plain form may lose every
// digit. Source: Jeannerod, Louvet, Muller 2013, "Further analysis of Kahan's algorithm".
template <typename T>
inline T DifferenceOfProducts(T a, T b, T c, T d) {
  const T cd = c * d;
  const T cd_error = std::fma(-c, d, cd);
  return std::fma(a, b, -cd) + cd_error;
}

// a b + c d, likewise.
template <typename T>
inline T SumOfProducts(T a, T b, T c, T d) {
  return DifferenceOfProducts(a, b, -c, d);
}

// Cross product that stays accurate if a and b are nearly parallel.
template <typename T>
inline Vec3<T> CrossAccurate(Vec3<T> a, Vec3<T> b) {
  return {DifferenceOfProducts(a.y, b.z, a.z, b.y), DifferenceOfProducts(a.z, b.x, a.x, b.z),
          DifferenceOfProducts(a.x, b.y, a.y, b.x)};
}

}  // namespace sheaf
