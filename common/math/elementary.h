// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Elementary functions whose bits depend only on this source: an image must not change with libm,
// its version or its run-time choice of instruction set. Everything is built from IEEE 754
// operations with one defined rounding (+, -, *, /, sqrt, fma).
//
// float: computed in double with polynomials accurate to about 2^-36, then rounded once: the error
// is at most 0.51 ulp. double: the maximum error in ulp stands at each declaration;
// elementary_test.cc measures both against long double. Special values (zeros and their signs,
// infinities, NaN) follow ISO C Annex F. Results that are subnormal are rounded correctly or to
// within 1 ulp.
//
// Trigonometric arguments: full accuracy for |x| <= kTrigArgumentMax. A larger finite argument has
// no meaningful phase and gives the value at 0; infinities give NaN.
//
// Polynomials are Taylor and atanh series after a reduction that makes them converge quickly, so
// that every coefficient can be checked by eye. Reductions: Cody and Waite 1980; Dekker 1971 for
// the parts held as unevaluated sums of two doubles; Muller, Elementary Functions, 3rd ed., ch. 11.
//
// Thread safety: pure functions.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

namespace sheaf {

inline constexpr double kPi = 0x1.921fb54442d18p+1;
inline constexpr double kTrigArgumentMax = 0x1p45;

template <typename T>
struct SinCosPair {
  T sin{}, cos{};
};

// Angles in radians. On the right: the maximum error of the double version, in ulp.
double Sin(double x);                 // 0.8
double Cos(double x);                 // 0.8
SinCosPair<double> SinCos(double x);  // Equals {Sin(x), Cos(x)} to the bit.
double Tan(double x);                 // 2.1
double Exp(double x);                 // 0.8
double Expm1(double x);               // 1.1
double Log(double x);                 // 0.7
double Log1p(double x);               // 0.7
double Pow(double x, double y);       // 0.8
double Asin(double x);                // 1.8
double Acos(double x);                // 1.6
double Atan(double x);                // 0.55
double Atan2(double y, double x);     // 0.55

namespace elementary {

// pi/2, ln 2 etc. as the double nearest to the value and the doubles nearest to the remainder.
inline constexpr double kHalfPi0 = 0x1.921fb54442d18p+0;
inline constexpr double kHalfPi1 = 0x1.1a62633145c07p-54;
inline constexpr double kHalfPi2 = -0x1.f1976b7ed8fbcp-110;
inline constexpr double kTwoOverPi = 0x1.45f306dc9c883p-1;
inline constexpr double kLn2 = 0x1.62e42fefa39efp-1;
inline constexpr double kLog2E = 0x1.71547652b82fep+0;
// Adding and subtracting this rounds |x| < 2^51 to the nearest integer and leaves that integer,
// modulo 2^51, in the low bits of the sum.
inline constexpr double kRoundShift = 0x1.8p52;

// c0 + c1 x + c2 x^2 + ... by Horner's rule.
inline double Polynomial(double /*x*/, double c) { return c; }
template <typename... Coefficients>
inline double Polynomial(double x, double c, Coefficients... rest) {
  return std::fma(Polynomial(x, rest...), x, c);
}

// 2^k. Requires: -1022 <= k <= 1023.
inline double PowerOfTwo(int64_t k) {
  return std::bit_cast<double>(static_cast<uint64_t>(k + 1023) << 52);
}

// x where |x| <= kTrigArgumentMax, 0 for other finite x, NaN otherwise.
inline double TrigArgument(double x) { return std::fabs(x) <= kTrigArgumentMax ? x : x - x; }

// Splits off quadrants: x = n pi/2 + remainder, |remainder| <= pi/4; quadrant = n mod 4.
struct Quadrant {
  double n;
  uint32_t quadrant;
};
inline Quadrant NearestQuadrant(double x) {
  const double shifted = std::fma(x, kTwoOverPi, kRoundShift);
  return {shifted - kRoundShift, static_cast<uint32_t>(std::bit_cast<uint64_t>(shifted) & 3)};
}

// Sine and cosine of x = remainder + quadrant * pi/2 from those of the remainder.
template <typename T>
inline SinCosPair<T> Rotate(SinCosPair<T> p, uint32_t quadrant) {
  const T s = quadrant & 1 ? p.cos : p.sin;
  const T c = quadrant & 1 ? p.sin : p.cos;
  return {quadrant & 2 ? -s : s, (quadrant + 1) & 2 ? -c : c};
}

// Accurate to 2^-36: the series end where the next term is smaller for |r| <= pi/4.
inline SinCosPair<double> SinCosForFloat(float x) {
  const double argument = TrigArgument(static_cast<double>(x));
  const Quadrant q = NearestQuadrant(argument);
  const double r = std::fma(-q.n, kHalfPi1, std::fma(-q.n, kHalfPi0, argument));
  const double z = r * r;
  const double s =
      r * Polynomial(z, 1.0, -1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800);
  const double c =
      Polynomial(z, 1.0, -0.5, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800, 1.0 / 479001600);
  return Rotate<double>({s, c}, q.quadrant);
}

// e^x = 2^k (1 + expm1_of_r), to 2^-36. Requires: |x| < 1000 or NaN.
struct ExpParts {
  double scale;  // 2^k.
  double expm1_of_r;
};
inline ExpParts ExpForFloat(double x) {
  const double shifted = std::fma(x, kLog2E, kRoundShift);
  const double k = shifted - kRoundShift;
  const double r = std::fma(-k, kLn2, x);
  const double e = r * Polynomial(r, 1.0, 1.0 / 2, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720,
                                  1.0 / 5040, 1.0 / 40320, 1.0 / 362880);
  // The low bits of `shifted` are k; adding the bias and shifting makes them an exponent.
  return {std::bit_cast<double>((std::bit_cast<uint64_t>(shifted) + 1023) << 52), e};
}
// Beyond these the float result is infinite or zero for any argument; NaN stays NaN.
inline double ClampExpArgument(double x) { return x > 89.0 ? 89.0 : (x < -104.0 ? -104.0 : x); }

// x = 2^k (1 + f) with 1 + f in [sqrt(1/2), sqrt(2)). Requires: x is positive, normal and finite.
struct LogParts {
  double k;
  double f;
};
inline LogParts SplitForLog(double x) {
  constexpr uint64_t kSqrtHalfBits = 0x3fe6a09e667f3bcd;
  const uint64_t bits = std::bit_cast<uint64_t>(x);
  const int64_t k = static_cast<int64_t>(bits - kSqrtHalfBits) >> 52;
  return {static_cast<double>(k),
          std::bit_cast<double>(bits - (static_cast<uint64_t>(k) << 52)) - 1.0};
}
// ln(1 + f) = 2 atanh(s), s = f / (2 + f), |s| <= 0.172; to 2^-39.
inline double Log1pSeries(double f) {
  const double s = f / (2.0 + f);
  const double z = s * s;
  return 2.0 * s * Polynomial(z, 1.0, 1.0 / 3, 1.0 / 5, 1.0 / 7, 1.0 / 9, 1.0 / 11, 1.0 / 13);
}
// Requires: x is positive, normal (as a double) and finite.
inline double LogForFloat(double x) {
  const LogParts p = SplitForLog(x);
  return std::fma(p.k, kLn2, Log1pSeries(p.f));
}

// Arc tangent of small / large in [0, pi/4], from the nearest of five known angles.
// Requires: 0 <= small <= large, large > 0, both finite.
inline double AtanFirstOctantForFloat(double small, double large) {
  constexpr double kAtan[5] = {0.0, 0x1.f5b75f92c80ddp-3, 0x1.dac670561bb4fp-2,
                               0x1.4978fa3269ee1p-1, 0x1.921fb54442d18p-1};
  const int i = (small > 0.125 * large) + (small > 0.375 * large) + (small > 0.625 * large) +
                (small > 0.875 * large);
  const double c = 0.25 * i;
  // atan(t) = atan(c) + atan((t - c) / (1 + t c)); the quotient is at most 1/8.
  const double t = std::fma(-c, large, small) / std::fma(c, small, large);
  const double z = t * t;
  return kAtan[i] + t * Polynomial(z, 1.0, -1.0 / 3, 1.0 / 5, -1.0 / 7, 1.0 / 9);
}
// For zeros and infinities: a finite quotient with the same angle.
template <typename T>
inline void MakeFiniteRatio(T* small, T* large) {
  if (*large == 0) *large = 1;
  if (std::isinf(*large)) {
    *small = std::isinf(*small) ? T(1) : T(0);
    *large = 1;
  }
}
inline double Atan2ForFloat(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return x + y;
  const double ay = std::fabs(y), ax = std::fabs(x);
  double small = ay < ax ? ay : ax, large = ay < ax ? ax : ay;
  MakeFiniteRatio(&small, &large);
  double angle = AtanFirstOctantForFloat(small, large);
  if (ay > ax) angle = kHalfPi0 - angle;
  if (std::signbit(x)) angle = kPi - angle;
  return std::copysign(angle, y);
}

enum class PowCase { kRegular, kNegatedRegular, kDone };
// Handles all cases except exp(y ln|x|) with |x| positive, finite and not 1, y finite and not 0.
// Source: ISO C17, F.10.4.4. *result is set if the return value is kDone.
template <typename T>
inline PowCase ClassifyPow(T x, T y, T* result) {
  *result = 1;
  if (y == 0 || x == 1) return PowCase::kDone;
  *result = x + y;
  if (std::isnan(x) || std::isnan(y)) return PowCase::kDone;
  const T ax = std::fabs(x);
  if (std::isinf(y)) {
    *result = ax == 1 ? T(1) : ((ax > 1) == (y > 0) ? std::numeric_limits<T>::infinity() : T(0));
    return PowCase::kDone;
  }
  const bool y_is_integer = std::floor(y) == y;
  const bool y_is_odd = y_is_integer && std::floor(y / 2) * 2 != y;
  const bool negate = std::signbit(x) && y_is_odd;
  if (ax == 0 || std::isinf(ax) || ax == 1) {
    T magnitude = 1;
    if (ax != 1) magnitude = (ax == 0) == (y < 0) ? std::numeric_limits<T>::infinity() : T(0);
    *result = negate ? -magnitude : magnitude;
    if (ax == 1 && !y_is_integer) *result = std::numeric_limits<T>::quiet_NaN();
    return PowCase::kDone;
  }
  if (x < 0 && !y_is_integer) {
    *result = std::numeric_limits<T>::quiet_NaN();
    return PowCase::kDone;
  }
  return negate ? PowCase::kNegatedRegular : PowCase::kRegular;
}

}  // namespace elementary

inline SinCosPair<float> SinCos(float x) {
  const SinCosPair<double> p = elementary::SinCosForFloat(x);
  return {static_cast<float>(p.sin), static_cast<float>(p.cos)};
}
inline float Sin(float x) { return static_cast<float>(elementary::SinCosForFloat(x).sin); }
inline float Cos(float x) { return static_cast<float>(elementary::SinCosForFloat(x).cos); }
inline float Tan(float x) {
  const SinCosPair<double> p = elementary::SinCosForFloat(x);
  return static_cast<float>(p.sin / p.cos);
}

inline float Exp(float x) {
  const elementary::ExpParts p = elementary::ExpForFloat(elementary::ClampExpArgument(x));
  return static_cast<float>(std::fma(p.scale, p.expm1_of_r, p.scale));
}
inline float Expm1(float x) {
  const elementary::ExpParts p = elementary::ExpForFloat(elementary::ClampExpArgument(x));
  if (p.scale == 1) return static_cast<float>(p.expm1_of_r);  // Keeps the sign of zero.
  return static_cast<float>(std::fma(p.scale, p.expm1_of_r, p.scale - 1.0));
}

inline float Log(float x) {
  if (!(x > 0) || std::isinf(x)) {  // Zero, negative, NaN and infinity.
    if (x == 0) return -std::numeric_limits<float>::infinity();
    return x < 0 ? std::numeric_limits<float>::quiet_NaN() : x;
  }
  return static_cast<float>(elementary::LogForFloat(x));
}
inline float Log1p(float x) {
  if (!(x > -1) || std::isinf(x)) {
    if (x == -1) return -std::numeric_limits<float>::infinity();
    return x < -1 ? std::numeric_limits<float>::quiet_NaN() : x;
  }
  const double wide = x;
  // Near 0, 1 + x would lose the significant digits.
  if (wide > -0.25 && wide < 0.375) return static_cast<float>(elementary::Log1pSeries(wide));
  return static_cast<float>(elementary::LogForFloat(1.0 + wide));
}

inline float Pow(float x, float y) {
  float result;
  const elementary::PowCase c = elementary::ClassifyPow(x, y, &result);
  if (c == elementary::PowCase::kDone) return result;
  const double exponent =
      static_cast<double>(y) * elementary::LogForFloat(std::fabs(static_cast<double>(x)));
  const elementary::ExpParts p = elementary::ExpForFloat(elementary::ClampExpArgument(exponent));
  const float magnitude = static_cast<float>(std::fma(p.scale, p.expm1_of_r, p.scale));
  return c == elementary::PowCase::kNegatedRegular ? -magnitude : magnitude;
}

inline float Atan2(float y, float x) { return static_cast<float>(elementary::Atan2ForFloat(y, x)); }
inline float Atan(float x) { return static_cast<float>(elementary::Atan2ForFloat(x, 1.0)); }
// NaN outside [-1, 1].
inline float Asin(float x) {
  const double wide = x;
  return static_cast<float>(
      elementary::Atan2ForFloat(wide, std::sqrt((1.0 - wide) * (1.0 + wide))));
}
// NaN outside [-1, 1].
inline float Acos(float x) {
  const double wide = x;
  return static_cast<float>(
      elementary::Atan2ForFloat(std::sqrt((1.0 - wide) * (1.0 + wide)), wide));
}

}  // namespace sheaf
