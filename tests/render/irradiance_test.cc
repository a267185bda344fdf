// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Irradiance of spheres, disks and rectangles against closed forms, at distances from a hundredth
// of the light's size to a million times it. Every estimate has a standard error from 16
// independent scrambles; the test is |z| <= 6 (two-sided 2.4e-5 for Student's t with 15 degrees of
// freedom; with about 60 comparisons a false alarm occurs for 1.5e-3 of all seeds, and the seed is
// fixed) plus a relative kFloatTolerance for rounding in float samples.
#include <gtest/gtest.h>

#include <cmath>

#include "common/math/elementary.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_tables.h"
#include "tests/support/naive_lights.h"

namespace sheaf::render {
namespace {

using testing::Estimate;
using testing::EstimateIrradiance;
using testing::kWhite;
using testing::MakeDistant;
using testing::MakePoint;
using testing::MakeSky;
using testing::MakeTable;

constexpr double kFloatTolerance = 5e-7;

void ExpectAt(double setting, const Estimate& estimate, double expected) {
  SCOPED_TRACE(setting);
  testing::ExpectNear(estimate, expected, kFloatTolerance);
}

// Limits the noise of an estimate: the standard deviation of one sample over the mean.
void ExpectRelativeNoiseBelow(const Estimate& estimate, double bound, double setting) {
  const double per_sample = estimate.standard_error * std::sqrt(1024.0 * kReplicateCount);
  EXPECT_LE(per_sample, bound * estimate.mean) << "at " << setting;
}

LightTableInput UnitSquareAt(float height, bool two_sided) {
  const float h = height;
  const Vec3f a{-0.5f, -0.5f, h}, b{0.5f, -0.5f, h}, c{0.5f, 0.5f, h}, d{-0.5f, 0.5f, h};
  LightTableInput input;
  // Facing down.
  input.triangles = {{a, c, b, kWhite, two_sided}, {a, d, c, kWhite, two_sided}};
  return input;
}

// Irradiance of a square centered above the receiver. Source: radiometry of a rectangle seen from
// its axis: four times the corner factor 1/(2 pi) (x/sqrt(1+x^2) atan(y/sqrt(1+x^2)) + the same
// with x and y exchanged).
double SquareIrradiance(double h) {
  const double x = 0.5 / h;
  const double root = std::sqrt(1 + x * x);
  return 4 * (x / root) * std::atan(x / root);
}

TEST(IrradianceTest, SquareAboveItsCenterAtAllDistances) {
  for (double h = 1e-2; h < 2e6; h *= 10) {
    const auto table = MakeTable(UnitSquareAt(static_cast<float>(h), false));
    const Estimate estimate = EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1});
    ExpectAt(h, estimate, SquareIrradiance(static_cast<double>(static_cast<float>(h))));
    ExpectRelativeNoiseBelow(estimate, 1.0, h);
  }
}

// Values of row L4.
TEST(IrradianceTest, SquareHasTheKnownValues) {
  const std::pair<float, double> kKnown[] = {
      {1.f, 0.752274688454}, {0.01f, 3.14056468}, {1000.f, 9.99999667e-7}};
  for (const auto& [h, expected] : kKnown) {
    const auto table = MakeTable(UnitSquareAt(h, true));
    const Estimate estimate = EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1});
    ExpectAt(static_cast<double>(h), estimate, expected);
    if (h < 1000) continue;
    ExpectHardCase({.row = "L4",
                    .figure = "irradiance under a unit square 1000 above",
                    .expected = expected,
                    .measured = estimate.mean,
                    .standard_error = estimate.standard_error,
                    .tolerance = kFloatTolerance * expected,
                    .naive = naive::SquareSolidAngle(h),
                    .naive_by = "sum of four angles less 2 pi"});
  }
}

TEST(IrradianceTest, SquareFarFromTheOrigin) {
  LightTableInput input = UnitSquareAt(3.f, false);
  const Vec3f offset{4096, -8192, 16384};
  for (TriangleEmitter& t : input.triangles) {
    t.v0 += offset;
    t.v1 += offset;
    t.v2 += offset;
  }
  const auto table = MakeTable(input);
  ExpectAt(3, EstimateIrradiance(*table, offset, {0, 0, 1}), SquareIrradiance(3));
}

TEST(IrradianceTest, SphereAtTheZenithAtAllDistances) {
  // Distances from the center; the nearest is a hundredth of the radius above the surface.
  for (double d : {1.01, 1.1, 2.0, 3.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6}) {
    LightTableInput input;
    input.spheres = {{{0, 0, d}, 1, kWhite}};
    const auto table = MakeTable(input);
    const Estimate estimate = EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1});
    ExpectAt(d, estimate, kPi / (d * d));
    ExpectRelativeNoiseBelow(estimate, 1.0, d);
  }
}

TEST(IrradianceTest, SphereSeenAtAnAngle) {
  // If the whole sphere is above the horizon, the irradiance is that at the zenith times the
  // cosine.
  for (double d : {2.0, 1e2, 1e5}) {
    LightTableInput input;
    input.spheres = {{{0.6 * d, 0, 0.8 * d}, 1, kWhite}};
    const auto table = MakeTable(input);
    ExpectAt(d, EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1}), 0.8 * kPi / (d * d));
  }
}

TEST(IrradianceTest, DiskOnItsAxisAtAllDistances) {
  for (double h = 1e-2; h < 2e6; h *= 10) {
    LightTableInput input;
    input.disks = {{{0, 0, h}, {0, 0, -1}, {1, 0, 0}, 1, 0, kWhite}};
    const auto table = MakeTable(input);
    const Estimate estimate = EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1});
    ExpectAt(h, estimate, kPi / (1 + h * h));
    ExpectRelativeNoiseBelow(estimate, 1.0, h);
  }
}

// Parallel disk of radius r, receiver at distance h from its plane and a from its axis.
// Source: Modest, Radiative Heat Transfer, configuration 15.
double ParallelDiskIrradiance(double r, double h, double a) {
  const double z = h * h + a * a + r * r;
  const double root = std::sqrt(z * z - 4 * a * a * r * r);
  // 1 - (h^2 + a^2 - r^2) / root, in a form that does not cancel far away.
  const double rest = h * h + a * a - r * r;
  return 0.5 * kPi * 4 * r * r * h * h / (root * (root + rest));
}

TEST(IrradianceTest, DiskOffItsAxis) {
  for (double a : {0.5, 0.999, 1.001, 2.0, 3.5, 5.0}) {
    for (double h : {1e-3, 1e-1, 1.0, 10.0}) {
      LightTableInput input;
      input.disks = {{{a, 0, h}, {0, 0, -1}, {1, 0, 0}, 1, 0, kWhite}};
      const auto table = MakeTable(input);
      const Estimate estimate = EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1});
      ExpectAt(a, estimate, ParallelDiskIrradiance(1, h, a));
    }
  }
}

TEST(IrradianceTest, RingIsADiskWithAHole) {
  for (double h : {0.1, 1.0, 20.0}) {
    LightTableInput input;
    input.disks = {{{0.3, 0, h}, {0, 0, -1}, {1, 0, 0}, 1, 0.5, kWhite}};
    const auto table = MakeTable(input);
    ExpectAt(h, EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1}),
             ParallelDiskIrradiance(1, h, 0.3) - ParallelDiskIrradiance(0.5, h, 0.3));
  }
}

TEST(IrradianceTest, ConstantSkyGivesPiOnAPlane) {
  const auto table = MakeTable({}, {MakeSky(kWhite)});
  ExpectAt(0, EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1}), kPi);
}

TEST(IrradianceTest, LightsOfAllKindsAddUp) {
  LightTableInput input = UnitSquareAt(1.f, false);
  input.spheres = {{{0, 0, 3}, 1, kWhite}};
  input.disks = {{{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, 1, 0, kWhite}};
  const auto table = MakeTable(
      input, {MakeSky(kWhite), MakeDistant(kWhite, {0, 0, 1}), MakePoint(kWhite, {0, 0, 2})});
  // Without occlusion every light contributes fully.
  ExpectAt(0, EstimateIrradiance(*table, {0, 0, 0}, {0, 0, 1}, 8192),
           SquareIrradiance(1) + kPi / 9 + kPi / 2 + kPi + 1 + 0.25);
}

}  // namespace
}  // namespace sheaf::render
