// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The double versions. If one more rounding would matter, a value is held as the unevaluated sum of
// two doubles (DoubleDouble).
#include "common/math/elementary.h"

namespace sheaf {
namespace elementary {
namespace {

struct DoubleDouble {
  double hi = 0, lo = 0;
};

// Exact sum. Requires: |a| >= |b| or a == 0. Source: Dekker 1971.
DoubleDouble FastTwoSum(double a, double b) {
  const double sum = a + b;
  return {sum, b - (sum - a)};
}
// Exact sum. Source: Knuth, TAOCP vol. 2, sec. 4.2.2.
DoubleDouble TwoSum(double a, double b) {
  const double sum = a + b;
  const double b_part = sum - a;
  return {sum, (a - (sum - b_part)) + (b - b_part)};
}
// Exact product.
DoubleDouble TwoProduct(double a, double b) {
  const double product = a * b;
  return {product, std::fma(a, b, -product)};
}
DoubleDouble Multiply(DoubleDouble a, DoubleDouble b) {
  const DoubleDouble p = TwoProduct(a.hi, b.hi);
  return FastTwoSum(p.hi, p.lo + std::fma(a.hi, b.lo, a.lo * b.hi));
}

// x - n pi/2 to about 2^-110 absolute. x - n * kHalfPi0 is exact: both are multiples of 2^-53 and
// the difference is below 1.
DoubleDouble ReduceByHalfPi(double x, double n) {
  const double exact = std::fma(-n, kHalfPi0, x);
  const DoubleDouble p = TwoProduct(n, kHalfPi1);
  const DoubleDouble r = TwoSum(exact, -p.hi);
  return FastTwoSum(r.hi, r.lo - std::fma(n, kHalfPi2, p.lo));
}

// Sine and cosine of r for |r| <= pi/4 (and slightly beyond).
SinCosPair<double> SinCosOfRemainder(DoubleDouble r) {
  const double z = r.hi * r.hi;
  const double s = Polynomial(z, -1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800,
                              1.0 / 6227020800, -1.0 / 1307674368000, 1.0 / 355687428096000);
  const double c = Polynomial(z, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800, 1.0 / 479001600,
                              -1.0 / 87178291200, 1.0 / 20922789888000);
  const double half = 0.5 * z;
  const double head = 1.0 - half;
  // The second-order terms account for r.lo: d sin = cos dr, d cos = -sin dr. z is not exact
  // either; its error is z_error, which enters the cosine as -z_error / 2.
  const double z_error = std::fma(r.hi, r.hi, -z);
  const double cos_tail = std::fma(z * z, c, -std::fma(r.hi, r.lo, 0.5 * z_error));
  return {r.hi + std::fma(r.hi * z, s, r.lo * head), head + (((1.0 - head) - half) + cos_tail)};
}

// 2^k value, rounded once even if the result is subnormal. Requires: |k| <= 2044.
double Scale(double value, int64_t k) {
  const int64_t first = k / 2;
  return value * PowerOfTwo(first) * PowerOfTwo(k - first);
}

struct ExpReduction {
  int64_t k;
  DoubleDouble r;  // |r| <= ln(2) / 2.
};
ExpReduction ReduceByLn2(DoubleDouble x) {
  // The leading part has 43 bits, so its product with k (11 bits) is exact.
  constexpr double kLn2Head = 0x1.62e42fefa3800p-1;
  constexpr double kLn2Tail = 0x1.ef35793c76730p-45;
  const double shifted = std::fma(x.hi, kLog2E, kRoundShift);
  const double k = shifted - kRoundShift;
  const double exact = std::fma(-k, kLn2Head, x.hi);
  const DoubleDouble tail = TwoProduct(-k, kLn2Tail);
  const DoubleDouble r = TwoSum(exact, tail.hi);
  return {static_cast<int64_t>(k), FastTwoSum(r.hi, r.lo + (tail.lo + x.lo))};
}
// e^r - 1 - r.hi for |r| <= ln(2) / 2.
double ExpTail(DoubleDouble r) {
  const double p =
      Polynomial(r.hi, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720, 1.0 / 5040, 1.0 / 40320,
                 1.0 / 362880, 1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800);
  const double z = r.hi * r.hi;
  const double z_error = std::fma(r.hi, r.hi, -z);
  return std::fma(0.5, z, std::fma(z * r.hi, p, std::fma(r.lo, r.hi, r.lo) + 0.5 * z_error));
}
// e^(x.hi + x.lo). Requires: -746 <= x.hi <= 710.
double ExpInRange(DoubleDouble x) {
  const ExpReduction e = ReduceByLn2(x);
  const DoubleDouble one_plus_r = FastTwoSum(1.0, e.r.hi);
  return Scale(one_plus_r.hi + (one_plus_r.lo + ExpTail(e.r)), e.k);
}

// k ln 2 + ln(1 + f) + correction, the last at most an ulp. With s = f / (2 + f): ln(1 + f) = 2
// atanh(s) = f - f^2/2 + s (f^2/2 + R), R = 2 s^2/3 + 2 s^4/5 + ...: the rounding error of s is
// damped by the small factor that multiplies it.
double LogSum(double k, double f, double correction) {
  constexpr double kLn2Head = 0x1.62e42fefa3800p-1;
  constexpr double kLn2Tail = 0x1.ef35793c76730p-45;
  const double s = f / (2.0 + f);
  const double z = s * s;
  const double rest = z * Polynomial(z, 2.0 / 3, 2.0 / 5, 2.0 / 7, 2.0 / 9, 2.0 / 11, 2.0 / 13,
                                     2.0 / 15, 2.0 / 17, 2.0 / 19, 2.0 / 21);
  const double square = f * f;
  const double square_error = std::fma(f, f, -square);
  const double half = 0.5 * square;
  const DoubleDouble head = FastTwoSum(f, -half);
  const double tail = std::fma(s, half + rest, head.lo - 0.5 * square_error + correction);
  if (k == 0) return head.hi + tail;
  const DoubleDouble sum = FastTwoSum(k * kLn2Head, head.hi);
  return sum.hi + (sum.lo + std::fma(k, kLn2Tail, tail));
}

constexpr double kSubnormalScale = 0x1p54;
// As SplitForLog, for subnormal x too.
LogParts SplitAnyForLog(double x) {
  if (x >= std::numeric_limits<double>::min()) return SplitForLog(x);
  LogParts p = SplitForLog(x * kSubnormalScale);
  p.k -= 54;
  return p;
}

// ln x to about 2^-66 relative, for Pow. Requires: x positive and finite.
DoubleDouble LogWide(double x) {
  const LogParts p = SplitAnyForLog(x);
  // s = f / (2 + f) as a double-double; f = m - 1 is exact.
  const DoubleDouble denominator = TwoSum(2.0, p.f);
  const double quotient = p.f / denominator.hi;
  const double remainder = std::fma(-quotient, denominator.hi, p.f) - quotient * denominator.lo;
  const DoubleDouble s = FastTwoSum(quotient, remainder / denominator.hi);
  const DoubleDouble z = Multiply(s, s);
  // 2 s (1 + z/3 + z^2 (1/5 + ...)): the last bracket may be rounded, it is below 0.0002.
  const double rest = z.hi * z.hi *
                      Polynomial(z.hi, 1.0 / 5, 1.0 / 7, 1.0 / 9, 1.0 / 11, 1.0 / 13, 1.0 / 15,
                                 1.0 / 17, 1.0 / 19, 1.0 / 21, 1.0 / 23);
  constexpr DoubleDouble kThird{0x1.5555555555555p-2, 0x1.5555555555555p-56};
  DoubleDouble series = Multiply(z, kThird);
  series = FastTwoSum(series.hi, series.lo + rest);
  const DoubleDouble correction = Multiply(s, series);
  DoubleDouble half_log = FastTwoSum(s.hi, correction.hi);
  half_log.lo += s.lo + correction.lo;
  const DoubleDouble log1p{2.0 * half_log.hi, 2.0 * half_log.lo};
  constexpr double kLn2Head = 0x1.62e42fefa3800p-1;
  constexpr double kLn2Tail = 0x1.ef35793c76730p-45;
  const DoubleDouble tail = TwoProduct(p.k, kLn2Tail);
  const DoubleDouble head = TwoSum(p.k * kLn2Head, log1p.hi);
  const DoubleDouble sum = TwoSum(head.hi, tail.hi);
  return FastTwoSum(sum.hi, sum.lo + (head.lo + tail.lo + log1p.lo));
}

// Arc tangent of small / large in [0, pi/4]. Requires: 0 <= small <= large, finite, and large
// within [2^-500, 2^500] so that no intermediate result under- or overflows.
DoubleDouble AtanFirstOctant(double small, double large) {
  constexpr DoubleDouble kAtan[5] = {{0.0, 0.0},
                                     {0x1.f5b75f92c80ddp-3, 0x1.8ab6e3cf7afbdp-57},
                                     {0x1.dac670561bb4fp-2, 0x1.a2b7f222f65e2p-56},
                                     {0x1.4978fa3269ee1p-1, 0x1.2419a87f2a458p-56},
                                     {0x1.921fb54442d18p-1, 0x1.1a62633145c07p-55}};
  const int i = (small > 0.125 * large) + (small > 0.375 * large) + (small > 0.625 * large) +
                (small > 0.875 * large);
  const double c = 0.25 * i;
  const DoubleDouble product = TwoProduct(c, small);
  const DoubleDouble denominator = FastTwoSum(large, product.hi);
  const double numerator = std::fma(-c, large, small);
  const double t = numerator / denominator.hi;
  const double t_error =
      (std::fma(-t, denominator.hi, numerator) - t * (denominator.lo + product.lo)) /
      denominator.hi;
  const double z = t * t;
  const double tail = t * z *
                      Polynomial(z, -1.0 / 3, 1.0 / 5, -1.0 / 7, 1.0 / 9, -1.0 / 11, 1.0 / 13,
                                 -1.0 / 15, 1.0 / 17, -1.0 / 19);
  const DoubleDouble sum = FastTwoSum(kAtan[i].hi, t);
  // A quotient that underflows has a negligible error term: 0 stays 0, subnormals stay as rounded.
  const double correction = small < large * 0x1p-1000 ? 0.0 : t_error + tail;
  return FastTwoSum(sum.hi, sum.lo + (kAtan[i].lo + correction));
}

}  // namespace
}  // namespace elementary

using elementary::DoubleDouble;

SinCosPair<double> SinCos(double x) {
  if (std::fabs(x) < 0x1p-27) return {x, 1.0};
  const double argument = elementary::TrigArgument(x);
  const elementary::Quadrant q = elementary::NearestQuadrant(argument);
  const DoubleDouble r = elementary::ReduceByHalfPi(argument, q.n);
  return elementary::Rotate(elementary::SinCosOfRemainder(r), q.quadrant);
}
double Sin(double x) { return SinCos(x).sin; }
double Cos(double x) { return SinCos(x).cos; }
double Tan(double x) {
  const SinCosPair<double> p = SinCos(x);
  return p.sin / p.cos;
}

double Exp(double x) {
  if (std::isnan(x)) return x;
  if (x > 710) return std::numeric_limits<double>::infinity();
  if (x < -746) return 0;
  return elementary::ExpInRange({x, 0});
}

double Expm1(double x) {
  if (std::isnan(x) || x == 0) return x;
  if (x > 710) return std::numeric_limits<double>::infinity();
  if (x < -40) return -1.0;  // e^-40 is below half an ulp of 1.
  const elementary::ExpReduction e = elementary::ReduceByLn2({x, 0});
  const double tail = elementary::ExpTail(e.r);
  if (e.k == 0) return e.r.hi + tail;
  if (e.k > 60) return elementary::ExpInRange({x, 0});
  const double scale = elementary::PowerOfTwo(e.k);
  // 2^k - 1 is exact up to k = 53; above that its rounding is below half an ulp of the result.
  const DoubleDouble head = elementary::TwoSum(scale - 1.0, scale * e.r.hi);
  return head.hi + std::fma(scale, tail, head.lo);
}

double Log(double x) {
  if (!(x > 0) || std::isinf(x)) {
    if (x == 0) return -std::numeric_limits<double>::infinity();
    return x < 0 ? std::numeric_limits<double>::quiet_NaN() : x;
  }
  const elementary::LogParts p = elementary::SplitAnyForLog(x);
  return elementary::LogSum(p.k, p.f, 0);
}

double Log1p(double x) {
  if (!(x > -1) || std::isinf(x)) {
    if (x == -1) return -std::numeric_limits<double>::infinity();
    return x < -1 ? std::numeric_limits<double>::quiet_NaN() : x;
  }
  if (std::fabs(x) < 0x1p-54) return x;
  if (x > -0.25 && x < 0.375) return elementary::LogSum(0, x, 0);
  const DoubleDouble u = elementary::TwoSum(1.0, x);
  const elementary::LogParts p = elementary::SplitForLog(u.hi);
  return elementary::LogSum(p.k, p.f, u.lo / u.hi);
}

double Pow(double x, double y) {
  double result;
  const elementary::PowCase c = elementary::ClassifyPow(x, y, &result);
  if (c == elementary::PowCase::kDone) return result;
  const DoubleDouble log = elementary::LogWide(std::fabs(x));
  const double estimate = y * log.hi;
  double magnitude;
  if (estimate > 710) {
    magnitude = std::numeric_limits<double>::infinity();
  } else if (estimate < -746) {
    magnitude = 0;
  } else {
    const DoubleDouble exponent = elementary::TwoProduct(y, log.hi);
    magnitude = elementary::ExpInRange({exponent.hi, std::fma(y, log.lo, exponent.lo)});
  }
  return c == elementary::PowCase::kNegatedRegular ? -magnitude : magnitude;
}

double Atan2(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return x + y;
  const double ay = std::fabs(y), ax = std::fabs(x);
  double small = ay < ax ? ay : ax, large = ay < ax ? ax : ay;
  elementary::MakeFiniteRatio(&small, &large);
  const double scale = large > 0x1p500 ? 0x1p-500 : (large < 0x1p-500 ? 0x1p574 : 1.0);
  DoubleDouble angle = elementary::AtanFirstOctant(small * scale, large * scale);
  if (ay > ax) {
    const DoubleDouble flipped = elementary::TwoSum(elementary::kHalfPi0, -angle.hi);
    angle = {flipped.hi, flipped.lo + (elementary::kHalfPi1 - angle.lo)};
  }
  if (std::signbit(x)) {
    const DoubleDouble flipped = elementary::TwoSum(kPi, -angle.hi);
    angle = {flipped.hi, flipped.lo + (2 * elementary::kHalfPi1 - angle.lo)};
  }
  return std::copysign(angle.hi + angle.lo, y);
}
double Atan(double x) { return Atan2(x, 1.0); }
double Asin(double x) { return Atan2(x, std::sqrt((1.0 - x) * (1.0 + x))); }
double Acos(double x) { return Atan2(std::sqrt((1.0 - x) * (1.0 + x)), x); }

}  // namespace sheaf
