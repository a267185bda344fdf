// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the stated errors, measured against long double (64-bit significand), and every special
// value.
#include "common/math/elementary.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <type_traits>
#include <vector>

namespace sheaf {
namespace {

using Wide = long double;

// |got - want| in units of the last place of T at want.
template <typename T>
double UlpError(T got, Wide want) {
  const T rounded = static_cast<T>(want);
  if (std::isnan(want)) return std::isnan(got) ? 0 : HUGE_VAL;
  if (std::isinf(rounded)) return got == rounded ? 0 : HUGE_VAL;
  if (!std::isfinite(got)) return HUGE_VAL;
  int exponent = 0;
  std::frexp(rounded == 0 ? std::numeric_limits<T>::denorm_min() : rounded, &exponent);
  const int last_place =
      std::max(exponent, std::numeric_limits<T>::min_exponent) - std::numeric_limits<T>::digits;
  return static_cast<double>(std::fabs(static_cast<Wide>(got) - want) /
                             std::ldexp(Wide{1}, last_place));
}

// Arguments: a dense uniform range, every magnitude, and the neighbors of special points.
template <typename T>
std::vector<T> Arguments(double low, double high, int exponent_min, int exponent_max) {
  constexpr int kDense = 60000, kScattered = 60000;
  std::mt19937_64 bits(7);
  std::vector<T> arguments;
  std::uniform_real_distribution<double> dense(low, high), mantissa(1, 2);
  for (int i = 0; i < kDense; ++i) arguments.push_back(static_cast<T>(dense(bits)));
  std::uniform_int_distribution<int> exponent(exponent_min, exponent_max);
  for (int i = 0; i < kScattered; ++i) {
    const double v = std::ldexp(mantissa(bits), exponent(bits));
    arguments.push_back(static_cast<T>(i & 1 ? -v : v));
  }
  for (int i = -64; i <= 64; ++i) {
    for (const Wide unit : {Wide{1}, std::acos(Wide{-1}) / 4, std::log(Wide{2}) / 2}) {
      const T v = static_cast<T>(unit * i);
      arguments.insert(arguments.end(),
                       {v, std::nextafter(v, T(1e30)), std::nextafter(v, T(-1e30))});
    }
  }
  return arguments;
}

struct Worst {
  double ulp = 0;
  double x = 0;
};
template <typename T, typename Ours, typename Theirs>
Worst Measure(const std::vector<T>& arguments, const Ours& ours, const Theirs& theirs) {
  Worst worst;
  for (const T x : arguments) {
    const double ulp = UlpError<T>(ours(x), theirs(static_cast<Wide>(x)));
    if (!(ulp <= worst.ulp)) worst = {ulp, static_cast<double>(x)};
  }
  return worst;
}

// float functions share one bound.
template <typename T>
double Limit(double of_double) {
  return std::is_same_v<T, float> ? 0.51 : of_double;
}
#define EXPECT_ULP(function, arguments, limit)                                       \
  do {                                                                               \
    const Worst worst = Measure<TypeParam>(                                          \
        arguments, [](TypeParam x) { return sheaf::function(x); },                   \
        [](Wide x) { return Reference##function(x); });                              \
    EXPECT_LE(worst.ulp, Limit<TypeParam>(limit)) << #function << " at " << worst.x; \
  } while (false)

Wide ReferenceSin(Wide x) { return std::sin(x); }
Wide ReferenceCos(Wide x) { return std::cos(x); }
Wide ReferenceTan(Wide x) { return std::tan(x); }
Wide ReferenceExp(Wide x) { return std::exp(x); }
Wide ReferenceExpm1(Wide x) { return std::expm1(x); }
Wide ReferenceLog(Wide x) { return std::log(x); }
Wide ReferenceLog1p(Wide x) { return std::log1p(x); }
Wide ReferenceAsin(Wide x) { return std::asin(x); }
Wide ReferenceAcos(Wide x) { return std::acos(x); }
Wide ReferenceAtan(Wide x) { return std::atan(x); }

template <typename T>
class ElementaryTest : public ::testing::Test {};
using Precisions = ::testing::Types<float, double>;
TYPED_TEST_SUITE(ElementaryTest, Precisions);

TYPED_TEST(ElementaryTest, TrigonometryIsWithinItsStatedError) {
  const auto arguments = Arguments<TypeParam>(-10, 10, -150, 44);
  EXPECT_ULP(Sin, arguments, 0.8);
  EXPECT_ULP(Cos, arguments, 0.8);
  EXPECT_ULP(Tan, arguments, 2.1);
}

TYPED_TEST(ElementaryTest, ExponentialsAreWithinTheirStatedError) {
  constexpr bool kFloat = std::is_same_v<TypeParam, float>;
  const auto arguments = Arguments<TypeParam>(kFloat ? -106 : -748, kFloat ? 90 : 711, -150, 9);
  EXPECT_ULP(Exp, arguments, 0.8);
  EXPECT_ULP(Expm1, arguments, 1.1);
  const auto small = Arguments<TypeParam>(-1, 1, -60, 0);
  EXPECT_ULP(Exp, small, 0.8);
  EXPECT_ULP(Expm1, small, 1.1);
}

TYPED_TEST(ElementaryTest, LogarithmsAreWithinTheirStatedError) {
  constexpr bool kFloat = std::is_same_v<TypeParam, float>;
  const auto arguments = Arguments<TypeParam>(0, 4, kFloat ? -149 : -1074, kFloat ? 127 : 1023);
  EXPECT_ULP(Log, arguments, 0.7);
  const auto near_zero = Arguments<TypeParam>(-1, 2, -100, 100);
  EXPECT_ULP(Log1p, near_zero, 0.7);
  const auto near_one = Arguments<TypeParam>(0.9, 1.1, -1, 1);
  EXPECT_ULP(Log, near_one, 0.7);
}

TYPED_TEST(ElementaryTest, InverseTrigonometryIsWithinItsStatedError) {
  const auto arguments = Arguments<TypeParam>(-1, 1, -120, 120);
  EXPECT_ULP(Asin, arguments, 1.8);
  EXPECT_ULP(Acos, arguments, 1.6);
  EXPECT_ULP(Atan, arguments, 0.55);
}

TYPED_TEST(ElementaryTest, TwoArgumentFunctionsAreWithinTheirStatedError) {
  using T = TypeParam;
  const double atan_limit = Limit<T>(0.55), pow_limit = Limit<T>(0.8);
  std::mt19937_64 bits(11);
  std::uniform_real_distribution<double> near(0.5, 1.6), exponent(-120, 120), sign(-1, 1);
  for (int i = 0; i < 100000; ++i) {
    const T x = static_cast<T>(std::copysign(std::exp2(exponent(bits)), sign(bits)));
    const T y = static_cast<T>(i & 1 ? static_cast<double>(x) * near(bits) * sign(bits)
                                     : std::copysign(std::exp2(exponent(bits)), sign(bits)));
    ASSERT_LE(UlpError<T>(Atan2(y, x), std::atan2(static_cast<Wide>(y), static_cast<Wide>(x))),
              atan_limit)
        << "atan2(" << y << ", " << x << ")";
    const T base = static_cast<T>(i & 1 ? near(bits) : std::exp2(exponent(bits)));
    const T power = static_cast<T>(i & 1 ? 20 * exponent(bits) : sign(bits) * 10);
    ASSERT_LE(
        UlpError<T>(Pow(base, power), std::pow(static_cast<Wide>(base), static_cast<Wide>(power))),
        pow_limit)
        << "pow(" << base << ", " << power << ")";
  }
}

TYPED_TEST(ElementaryTest, SinCosEqualsSinAndCos) {
  for (const TypeParam x : Arguments<TypeParam>(-10, 10, -150, 60)) {
    const SinCosPair<TypeParam> pair = SinCos(x);
    ASSERT_EQ(pair.sin, Sin(x)) << x;
    ASSERT_EQ(pair.cos, Cos(x)) << x;
  }
}

template <typename T>
void ExpectSame(T got, T want, const char* what) {
  if (std::isnan(want)) {
    EXPECT_TRUE(std::isnan(got)) << what << " gave " << got;
  } else {
    EXPECT_EQ(got, want) << what;
    EXPECT_EQ(std::signbit(got), std::signbit(want)) << what << ": sign of zero";
  }
}
#define EXPECT_SAME(got, want) ExpectSame<TypeParam>(got, want, #got)

TYPED_TEST(ElementaryTest, SpecialValuesOfOneArgumentFollowAnnexF) {
  using T = TypeParam;
  constexpr T kInf = std::numeric_limits<T>::infinity(), kNan = std::numeric_limits<T>::quiet_NaN();
  for (const T zero : {T(0), -T(0)}) {
    EXPECT_SAME(Sin(zero), zero);
    EXPECT_SAME(Tan(zero), zero);
    EXPECT_SAME(Expm1(zero), zero);
    EXPECT_SAME(Log1p(zero), zero);
    EXPECT_SAME(Asin(zero), zero);
    EXPECT_SAME(Atan(zero), zero);
    EXPECT_SAME(Cos(zero), T(1));
    EXPECT_SAME(Exp(zero), T(1));
    EXPECT_SAME(Log(zero), -kInf);
  }
  for (const T x : {kInf, -kInf, kNan}) {
    EXPECT_SAME(Sin(x), kNan);
    EXPECT_SAME(Cos(x), kNan);
    EXPECT_SAME(Tan(x), kNan);
    EXPECT_SAME(Asin(x), kNan);
    EXPECT_SAME(Acos(x), kNan);
  }
  EXPECT_SAME(Exp(kInf), kInf);
  EXPECT_SAME(Exp(-kInf), T(0));
  EXPECT_SAME(Exp(kNan), kNan);
  EXPECT_SAME(Expm1(kInf), kInf);
  EXPECT_SAME(Expm1(-kInf), T(-1));
  EXPECT_SAME(Expm1(kNan), kNan);
  EXPECT_SAME(Log(kInf), kInf);
  EXPECT_SAME(Log(T(-1)), kNan);
  EXPECT_SAME(Log(kNan), kNan);
  EXPECT_SAME(Log(T(1)), T(0));
  EXPECT_SAME(Log1p(T(-1)), -kInf);
  EXPECT_SAME(Log1p(T(-2)), kNan);
  EXPECT_SAME(Log1p(kInf), kInf);
  EXPECT_SAME(Asin(T(1)), static_cast<T>(kPi / 2));
  EXPECT_SAME(Asin(std::nextafter(T(1), T(2))), kNan);
  EXPECT_SAME(Acos(T(1)), T(0));
  EXPECT_SAME(Acos(T(-1)), static_cast<T>(kPi));
  EXPECT_SAME(Atan(kInf), static_cast<T>(kPi / 2));
  EXPECT_SAME(Atan(-kInf), static_cast<T>(-kPi / 2));
}

TYPED_TEST(ElementaryTest, SpecialValuesOfTwoArgumentsAgreeWithTheStandardLibrary) {
  using T = TypeParam;
  constexpr T kInf = std::numeric_limits<T>::infinity(), kNan = std::numeric_limits<T>::quiet_NaN();
  constexpr T kTiny = std::numeric_limits<T>::denorm_min(), kHuge = std::numeric_limits<T>::max();
  const std::vector<T> values{0,  -T(0), 1,     -1,   T(0.5), T(-0.5), 2,     -2,    3,
                              -3, kInf,  -kInf, kNan, kTiny,  -kTiny,  kHuge, -kHuge};
  for (const T a : values) {
    for (const T b : values) {
      // glibc rounds these to within 1 ulp, so compare with it; zeros, infinities and NaN exactly.
      const T want_pow = std::pow(a, b), want_atan2 = std::atan2(a, b);
      SCOPED_TRACE(::testing::Message() << "a = " << a << ", b = " << b);
      if (std::isnormal(want_pow)) {
        EXPECT_LE(UlpError<T>(Pow(a, b), want_pow), 1);
      } else {
        EXPECT_SAME(Pow(a, b), want_pow);
      }
      if (std::isnormal(want_atan2)) {
        EXPECT_LE(UlpError<T>(Atan2(a, b), want_atan2), 1);
      } else {
        EXPECT_SAME(Atan2(a, b), want_atan2);
      }
    }
  }
}

TYPED_TEST(ElementaryTest, ArgumentsTooLargeForAPhaseStayFinite) {
  using T = TypeParam;
  for (const T x : {static_cast<T>(1e15), static_cast<T>(-1e30), std::numeric_limits<T>::max()}) {
    EXPECT_SAME(Sin(x), T(0));
    EXPECT_SAME(Cos(x), T(1));
    EXPECT_SAME(Tan(x), T(0));
  }
}

}  // namespace
}  // namespace sheaf
