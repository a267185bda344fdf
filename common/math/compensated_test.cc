// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/compensated.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include "common/math/double_float.h"
#include "common/math/next_float.h"

namespace sheaf {
namespace {

TEST(CompensatedTest, DifferenceOfProductsSurvivesCancellation) {
  std::mt19937 bits(9);
  std::uniform_real_distribution<float> near_one(0.999f, 1.001f);
  for (int i = 0; i < 100000; ++i) {
    const float a = near_one(bits), b = near_one(bits), c = near_one(bits), d = near_one(bits);
    // Products of floats are exact in double, and so is their difference this close to 0.
    const double exact = double{a} * b - double{c} * d;
    ASSERT_LE(std::fabs(DifferenceOfProducts(a, b, c, d) - exact),
              1.5 * 0x1p-23 * std::fabs(exact));
  }
  // The plain form in double gives 0 here.
  const double a = 1 + 0x1p-30, b = 1 - 0x1p-30;
  EXPECT_EQ(DifferenceOfProducts(a, b, 1.0, 1.0), -0x1p-60);
  EXPECT_EQ(SumOfProducts(a, b, -1.0, 1.0), -0x1p-60);
}

TEST(CompensatedTest, CrossOfNearlyParallelVectors) {
  const Vec3f a{1, 1 + 0x1p-22f, 1}, b{1, 1, 1 + 0x1p-22f};
  const Vec3d exact = Cross(ToDouble(a), ToDouble(b));
  EXPECT_LE(Length(ToDouble(CrossAccurate(a, b)) - exact), 2e-7 * Length(exact));
}

TEST(DoubleFloatTest, HoldsFortyEightBits) {
  std::mt19937_64 bits(13);
  std::uniform_real_distribution<double> value(-2, 2);
  for (int i = 0; i < 100000; ++i) {
    const double v = value(bits);
    const DoubleFloat wide = DoubleFloat::Make(v);
    ASSERT_LE(std::fabs(wide.Value() - v), 0x1p-49 * std::fabs(v));
    ASSERT_EQ(DoubleFloat::Make(wide.Value()), wide);
    ASSERT_EQ(wide.hi, static_cast<float>(wide.Value()));
  }
  // A tail that rounds up to the tie: without special handling 1 + half an ulp has two forms.
  const double tie = double{1 + 0x1p-23f} + (0x1p-24 - 0x1p-52);
  EXPECT_EQ(DoubleFloat::Make(DoubleFloat::Make(tie).Value()), DoubleFloat::Make(tie));
}

TEST(DoubleFloatTest, LongSumsKeepPrecision) {
  DoubleFloat sum;
  for (int i = 0; i < 1 << 20; ++i) sum = Add(sum, DoubleFloat::Make(1 + 0x1p-20));
  EXPECT_NEAR(sum.Value(), (1 << 20) + 1.0, 1e-4);
}

TEST(NextFloatTest, StepsAcrossZeroAndStopsAtInfinity) {
  constexpr float kInf = std::numeric_limits<float>::infinity();
  constexpr float kTiny = std::numeric_limits<float>::denorm_min();
  for (const float v : {1.0f, -1.0f, 1.5e38f, kTiny, -kTiny, 0.0f, -0.0f, -kInf}) {
    EXPECT_EQ(NextUp(v), std::nextafter(v, kInf)) << v;
    EXPECT_EQ(NextDown(-v), std::nextafter(-v, -kInf)) << v;
    if (std::isinf(v)) continue;
    const Floats4 beside = NextTowards(Floats4{v, v, v, v}, Floats4{2.5f, -1e-40f, 0, -0.0f});
    EXPECT_EQ(beside[0], NextUp(v)) << v;
    EXPECT_EQ(beside[1], NextDown(v)) << v;
    EXPECT_EQ(std::bit_cast<uint32_t>(beside[2]), std::bit_cast<uint32_t>(v)) << v;
    EXPECT_EQ(beside[3], v) << v;
  }
  EXPECT_EQ(NextUp(kInf), kInf);
  EXPECT_EQ(NextDown(-kInf), -kInf);
  EXPECT_TRUE(std::isnan(NextUp(std::numeric_limits<float>::quiet_NaN())));
  EXPECT_EQ(NextUp(std::numeric_limits<float>::max()), kInf);
  EXPECT_EQ(NextUp(1.0), 1 + 0x1p-52);
  EXPECT_EQ(NextDown(0.0), -std::numeric_limits<double>::denorm_min());
}

}  // namespace
}  // namespace sheaf
