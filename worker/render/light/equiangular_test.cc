// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/equiangular.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "tests/support/hard_case.h"
#include "tests/support/naive_media.h"

namespace sheaf::render {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

EquiangularDistances Along(double height, double begin, double end, double radius = 0) {
  const auto line =
      EquiangularDistances::Make({0, 0, 0}, {0, 0, 1}, begin, end, {0, height, 0}, radius);
  EXPECT_TRUE(line.has_value());
  return line.value_or(EquiangularDistances());
}

struct Span {
  double height, begin, end;
};
// Lights at any height above the ray, and spans of any length, far from the light on either side.
const std::vector<Span> kSpans = {{1, -1, 1},        {1, 0, 1e6},         {1, 1e2, 1e2 + 1},
                                  {1, 1e4, 1e4 + 1}, {1, -1e6 - 1, -1e6}, {1e-6, 0.5, 2},
                                  {1e-12, 0.5, 2},   {0, 0.5, 2},         {0, -7, -0.1},
                                  {1e-8, -1, 1},     {1e6, 0, 1},         {1e-30, 1, 1 + 1e-9},
                                  {0, 3, kInfinity}, {2, -5, kInfinity},  {1e-9, 1e-3, kInfinity}};

// V7: the integral of Pdf from the beginning to the result of Sample(u) is u, by the closed-form
// integral in extended precision.
TEST(EquiangularTest, V7SamplesInvertTheIntegralOfThePdf) {
  for (const Span& span : kSpans) {
    SCOPED_TRACE(::testing::Message() << span.height << " " << span.begin << " " << span.end);
    const EquiangularDistances line = Along(span.height, span.begin, span.end);
    const auto h = static_cast<long double>(span.height), a = static_cast<long double>(span.begin);
    const auto integral = [&](long double b) {
      if (h == 0) return 1 / a - 1 / b;
      return atan2l(b - a, h + a * (b / h)) / h;
    };
    const long double whole = std::isinf(span.end) ? (h == 0 ? 1 / a : atan2l(h, a) / h)
                                                   : integral(static_cast<long double>(span.end));
    for (int i = 0; i < 64; ++i) {
      const double u = (i + 0.5) / 64;
      const double t = line.Sample(u);
      ASSERT_GE(t, span.begin);
      ASSERT_LE(t, span.end);
      const auto x = static_cast<long double>(t);
      const auto fraction = static_cast<double>(integral(x) / whole);
      // The rounding of distances limits the resolution of the integral.
      const auto pdf = static_cast<double>(1 / ((h * h + x * x) * whole));
      EXPECT_NEAR(fraction, u,
                  1e-12 + 4 * std::numeric_limits<double>::epsilon() * (1 + std::fabs(t) * pdf) /
                              std::min(1.0, 1 - u));
      EXPECT_NEAR(line.Pdf(t) / pdf, 1, 1e-9);
    }
    if (span.height != 1 || span.begin < 1e2 || std::isinf(span.end)) continue;
    const double begin = span.begin;
    const auto angle = static_cast<double>(whole);
    ExpectHardCase(
        {.row = "V7",
         .figure = "angle of a unit span " + InWords(begin) + " away",
         .expected = angle,
         .measured = 1 / (line.Pdf(begin) * (1 + begin * begin)),
         .tolerance = 1e-9 * angle,
         .naive = naive::AngleOfSpan(1, static_cast<float>(begin), static_cast<float>(span.end)),
         .naive_by = "difference of two arctangents"});
  }
}

TEST(EquiangularTest, V7PdfIsZeroOutsideTheSpan) {
  const EquiangularDistances line = Along(1, 2, 3);
  EXPECT_EQ(line.Pdf(1.999), 0);
  EXPECT_EQ(line.Pdf(3.001), 0);
}

TEST(EquiangularTest, RaysThroughAPointLightHaveNoDistances) {
  EXPECT_FALSE(EquiangularDistances::Make({}, {0, 0, 1}, 0, 2, {0, 0, 1}, 0));
  EXPECT_FALSE(EquiangularDistances::Make({}, {0, 0, 1}, 1, 1, {0, 1, 1}, 0));
  EXPECT_TRUE(EquiangularDistances::Make({}, {0, 0, 1}, 0, 2, {0, 0, 1}, 0.1));
}

TEST(EquiangularTest, G2PowersOfTwoChangeNoBit) {
  const double scale = 0x1p20;
  for (const Span& span : kSpans) {
    const EquiangularDistances line = Along(span.height, span.begin, span.end, 0.01);
    const EquiangularDistances scaled =
        Along(span.height * scale, span.begin * scale, span.end * scale, 0.01 * scale);
    for (int i = 0; i < 16; ++i) {
      const double t = line.Sample(i / 16.0);
      EXPECT_EQ(scaled.Sample(i / 16.0), t * scale);
      EXPECT_EQ(scaled.Pdf(t * scale) * scale, line.Pdf(t));
    }
  }
}

// --- Spans that a light illuminates -------------------------------------------------------------

// Checks that Pdf is positive exactly on [*begin, *end], to steps of 2^-10.
void ExpectLit(const LightBounds& light, Vec3d o, Vec3d d, double length, double begin,
               double end) {
  const auto line = DistancesTo(light, o, d, 0, length);
  if (begin >= end) {
    EXPECT_FALSE(line.has_value());
    return;
  }
  ASSERT_TRUE(line.has_value());
  for (double t = 0; t <= 16; t += 0x1p-10) {
    if (std::fabs(t - begin) < 1e-5 || std::fabs(t - end) < 1e-5) continue;
    ASSERT_EQ(line->Pdf(t) > 0, t > begin && t < end) << t;
  }
}

TEST(EquiangularTest, FlatLightsEmitToOneSide) {
  LightBounds panel{.kind = LightBounds::Kind::kPlanar,
                    .two_sided = false,
                    .center = {0, 1, 4},
                    .normal = {0, 0, 1},
                    .radius = 0.5f,
                    .area = 1,
                    .strength = 1};
  ExpectLit(panel, {}, {0, 0, 1}, 10, 4, 10);
  ExpectLit(panel, {}, {0, 0, 1}, kInfinity, 4, kInfinity);
  ExpectLit(panel, {0, 0, 9}, {0, 0, -1}, 10, 0, 5);
  ExpectLit(panel, {}, {0, 0, -1}, 10, 0, 0);
  ExpectLit(panel, {0, 0, 5}, {0, 1, 0}, 10, 0, 10);
  ExpectLit(panel, {0, 0, 3}, {0, 1, 0}, 10, 0, 0);
  panel.two_sided = true;
  ExpectLit(panel, {0, 0, 3}, {0, 1, 0}, 10, 0, 10);
}

TEST(EquiangularTest, SpotsEmitInTheirCone) {
  const LightBounds spot{.kind = LightBounds::Kind::kPoint,
                         .center = {0, 4, 5},
                         .normal = {0, -1, 0},
                         .strength = 1,
                         .cos_end = std::sqrt(0.5f)};
  ExpectLit(spot, {}, {0, 0, 1}, 16, 1, 9);
  ExpectLit(spot, {}, {0, 0, 1}, 6, 1, 6);
  ExpectLit(spot, {}, {0, 0, -1}, 16, 0, 0);
  ExpectLit(spot, {0, 8, 0}, {0, 0, 1}, 16, 0, 0);  // Through the cone's mirror image.
  ExpectLit(spot, {0, 0, 5}, {0, -1, 0}, kInfinity, 0, kInfinity);
  ExpectLit(spot, {0, 0, 5}, {0, 1, 0}, 16, 0, 0);  // Through its apex, which is a single point.
  const LightBounds wide{
      .kind = LightBounds::Kind::kPoint, .center = {0, 4, 5}, .normal = {0, -1, 0}, .strength = 1};
  ExpectLit(wide, {0, 8, 0}, {0, 0, 1}, 16, 0, 16);
}

// Thin media scatter rarely, which raises the spread; dense ones only where the light is near.
TEST(EquiangularTest, SpreadIsLargeWhereScatteringIsRareOrLightIsNear) {
  const auto spread = [](double height, double extinction) {
    const LightBounds light{.kind = LightBounds::Kind::kPoint,
                            .center = {0, static_cast<float>(height), 4},
                            .strength = 1};
    return DistanceSamplingSpread(light, {}, {0, 0, 1}, 0, 8, extinction);
  };
  EXPECT_NEAR(spread(1e3, 1e-4), 1 / (8e-4), 1);
  EXPECT_NEAR(spread(1e3, 10), 1, 1e-3);
  EXPECT_LT(spread(8, 0.5), kSpreadGathered);
  EXPECT_GT(spread(0.02, 0.5), kSpreadGathered);
  EXPECT_LT(spread(0.02, 50), kSpreadGathered);
}

TEST(EquiangularTest, LightsWithoutPositionHaveNoDistances) {
  EXPECT_FALSE(
      DistancesTo({.kind = LightBounds::Kind::kInfinite, .strength = 1}, {}, {0, 0, 1}, 0, 1));
}

}  // namespace
}  // namespace sheaf::render
