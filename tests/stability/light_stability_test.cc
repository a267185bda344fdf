// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows L1 to L5 of the catalogue of hard cases: spheres, triangles, rectangles, disks and delta
// lights; light_table_stability_test.cc has the others. The tolerance of Monte Carlo comparisons is
// 6 standard errors (from 16 independent scrambles) plus the rounding of float samples.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_tables.h"
#include "tests/support/naive_lights.h"
#include "worker/render/light/shape_sampling.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

using testing::Estimate;
using testing::EstimateIrradiance;
using testing::EstimateMean;
using testing::ExpectNear;
using testing::kOrigin;
using testing::kUp;
using testing::kWhite;
using testing::MakePoint;
using testing::MakeSpot;
using testing::MakeTable;
using testing::RandomPoints;

// --- L1, L2: spheres ---------------------------------------------------------------------------

TEST(LightStabilityTest, L1SphereFarAwayIsNotAPoint) {
  for (double d = 1.5; d < 2e6; d *= 2) {
    LightTableInput input;
    input.spheres = {{{0, 0, d}, 1, kWhite}};
    const auto table = MakeTable(input);
    const Estimate estimate = EstimateIrradiance(*table, kOrigin, kUp);
    ExpectNear(estimate, kPi / (d * d));
    // At a large distance the estimate has almost no variance.
    EXPECT_NEAR(estimate.mean * d * d / kPi, 1, d > 1e3 ? 1e-5 : 1e-2);
    if (d == 1.5 * (1 << 10) || d == 1.5 * (1 << 13)) {
      const auto distance = static_cast<float>(d);
      ExpectHardCase({.row = "L1",
                      .figure = "irradiance over its value, " + InWords(d) + " radii from a sphere",
                      .expected = 1,
                      .measured = estimate.mean * d * d / kPi,
                      .tolerance = 1e-5,
                      .naive = naive::SphereSolidAngle(1, distance) * distance * distance /
                               static_cast<float>(kPi),
                      .naive_by = "solid angle as 2 pi (1 - cos)"});
    }
    // Samples spread over the whole visible disk, not over one point.
    RandomPoints random(1);
    double spread = 0;
    for (int i = 0; i < 200; ++i) {
      const auto sample = table->Sample<kAllTraits>(kOrigin, kUp, 0, random.Next2());
      ASSERT_TRUE(sample.has_value());
      spread = std::max(spread, std::hypot(double{sample->p_light.x}, double{sample->p_light.y}));
    }
    EXPECT_GT(spread, 0.6);
    EXPECT_LT(spread, 1.01);
  }
}

TEST(LightStabilityTest, L1KnownValue) {
  LightTableInput input;
  input.spheres = {{{0, 0, 3}, 1, kWhite}};
  ExpectNear(EstimateIrradiance(*MakeTable(input), kOrigin, kUp), 0.349065850, 2e-7);
}

TEST(LightStabilityTest, L2InsideASphereIrradianceIsPiForAnyNormal) {
  LightTableInput input;
  input.spheres = {{{0, 0, 0}, 1, kWhite, false, true}};
  const auto table = MakeTable(input);
  for (const Vec3f& p :
       {Vec3f{0, 0, 0}, Vec3f{0.5f, 0.1f, -0.3f}, Vec3f{0, 0, 0.999f}, Vec3f{1, 0, 0}}) {
    for (const Vec3f& n : {Vec3f{0, 0, 1}, Vec3f{1, 0, 0}, Vec3f{-0.6f, 0, 0.8f}}) {
      ExpectNear(EstimateIrradiance(*table, p, n, 4096), kPi);
    }
  }
  const Estimate estimate = EstimateIrradiance(*table, {0.5f, 0.1f, -0.3f}, {1, 0, 0}, 4096);
  ExpectHardCase({.row = "L2",
                  .figure = "irradiance within a sphere light",
                  .expected = kPi,
                  .measured = estimate.mean,
                  .standard_error = estimate.standard_error,
                  .tolerance = 1e-6 * kPi,
                  .naive = naive::SphereSolidAngle(1, Length(Vec3f{0.5f, 0.1f, -0.3f})),
                  .naive_by = "cone of cosine sqrt(1 - R^2 / d^2)"});
}

TEST(LightStabilityTest, L2OnTheSurfaceIrradianceIsPiAndContinuous) {
  // The distance of p from the center over the radius; at 1, rounding may put p on either side.
  for (const Vec3d& direction : {Vec3d{0, 0, 1}, Vec3d{0.48, 0.6, 0.64}, Vec3d{-0.6, 0.8, 0}}) {
    for (double factor : {1.0, 1 + 1e-7, 1 + 1e-6, 1 + 1e-4, 1 + 1e-2}) {
      LightTableInput input;
      input.spheres = {{{0, 0, 0}, 1, kWhite}};
      const auto table = MakeTable(input);
      const Vec3f p = ToFloat(direction * factor), n = ToFloat(-direction);
      const Estimate estimate = EstimateIrradiance(*table, p, n, 4096);
      const double d_squared = LengthSquared(ToDouble(p));
      ExpectNear(estimate, kPi / std::max(d_squared, 1.0), 1e-5);
    }
  }
}

TEST(LightStabilityTest, L2OutwardSphereIsDarkInsideAndInwardSphereOutside) {
  LightTableInput input;
  input.spheres = {{{0, 0, 0}, 1, kWhite, false, false}};
  EXPECT_FALSE(MakeTable(input)->Sample<kAllTraits>({0.2f, 0, 0}, {}, 0.5f, {0.5f, 0.5f}));
  input.spheres[0].inward = true;
  EXPECT_FALSE(MakeTable(input)->Sample<kAllTraits>({2, 0, 0}, {}, 0.5f, {0.5f, 0.5f}));
}

// --- L3: triangles -----------------------------------------------------------------------------

// Exact far and near fields of solid angles: an octant of the sphere and related shapes.
TEST(LightStabilityTest, L3SolidAngleIsAccurateAtEveryDistance) {
  // Corner triangle (d,0,0), (0,d,0), (0,0,d) seen from the origin: an octant, pi/2, at any scale.
  for (float d : {1e-10f, 1e-3f, 1.f, 1e3f, 1e12f}) {
    const TriangleView view = ViewTriangle({d, 0, 0}, {0, d, 0}, {0, 0, d}, kOrigin);
    EXPECT_NEAR(view.solid_angle, kPi / 2, 1e-10);
  }
  // Right triangle with unit legs in the plane at distance d: area / d^2 (1 - c / d^2) far away.
  for (float d : {1e2f, 1e3f, 1e4f, 1e5f, 1e6f}) {
    const TriangleView view = ViewTriangle({0, 0, d}, {1, 0, d}, {0, 1, d}, kOrigin);
    const double dd = static_cast<double>(d) * static_cast<double>(d);
    // Mean of 1 - 1.5 (x^2 + y^2) / d^2 over the triangle; mean of x^2 + y^2 is 1/3.
    EXPECT_NEAR(view.solid_angle * 2 * dd, 1 - 0.5 / dd, 1e-7);
    if (d != 1e3f && d != 1e4f) continue;
    ExpectHardCase({.row = "L3",
                    .figure = d == 1e3f ? "solid angle over area / d^2 at 1000"
                                        : "solid angle over area / d^2 at 10000",
                    .expected = 1 - 0.5 / dd,
                    .measured = view.solid_angle * 2 * dd,
                    .tolerance = 1e-7,
                    .naive = naive::TriangleSolidAngle({0, 0, d}, {1, 0, d}, {0, 1, d}) * 2 * d * d,
                    .naive_by = "excess of the angles over pi"});
  }
  // A needle 1 x h at distance 2: linear in h.
  double previous = 0;
  for (float h : {1e-6f, 1e-5f, 1e-4f, 1e-3f}) {
    const double per_h =
        ViewTriangle({-0.5f, 0, 2}, {0.5f, 0, 2}, {0, h, 2}, kOrigin).solid_angle / double{h};
    EXPECT_NEAR(per_h / (previous > 0 ? previous : per_h), 1, 1e-6);
    previous = per_h;
  }
}

// The pdf integrates to 1 and 1/pdf to the solid angle, both as expectations over the samples.
TEST(LightStabilityTest, L3MeanOfInversePdfIsTheSolidAngle) {
  for (float d = 1; d < 2e8f; d *= 10) {
    LightTableInput input;
    input.triangles = {{{0, 0, d}, {0, 1, d}, {1, 0, d}, kWhite}};
    const auto table = MakeTable(input);
    const Estimate estimate = EstimateMean(256, [&](const std::array<float, 4>& u) {
      const auto sample = table->Sample<kAllTraits>(kOrigin, kUp, u[0], {u[1], u[2]});
      return sample ? 1 / static_cast<double>(sample->pdf) : 0.0;
    });
    ExpectNear(estimate, ViewTriangle({0, 0, d}, {0, 1, d}, {1, 0, d}, kOrigin).solid_angle, 2e-7);
  }
}

// The pdfs of samples and those looked up at the same points, over random shapes of all scales:
// equal bits, never NaN, never 0.
TEST(LightStabilityTest, L3SampleAndLookupPdfsAreBitIdentical) {
  RandomPoints random(31);
  const auto vector = [&](float scale) {
    return Vec3f{(random.Next() - 0.5f) * scale, (random.Next() - 0.5f) * scale,
                 (random.Next() - 0.5f) * scale};
  };
  int found = 0;
  for (int i = 0; i < 20000; ++i) {
    const float size = std::pow(10.f, 12 * random.Next() - 6);
    const float distance = std::pow(10.f, 12 * random.Next() - 6);
    const Vec3f at = vector(distance);
    LightTableInput input;
    input.triangles = {{at + vector(size), at + vector(size), at + vector(size), kWhite, true}};
    const Vec3f axis = vector(1);
    if (!(Length(axis) > 1e-2f)) continue;
    const Vec3d normal = Normalize(ToDouble(axis));
    const Vec3d side =
        Normalize(Cross(normal, std::fabs(normal.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}));
    input.disks = {{ToDouble(at + vector(size)), normal, side, double{size}, 0.3 * double{size},
                    kWhite, true}};
    input.spheres = {{ToDouble(at), double{size}, kWhite, true}};
    const auto table = MakeTable(input);
    for (float select : {0.1f, 0.4f, 0.9f}) {
      const auto sample = table->Sample<kAllTraits>(kOrigin, {}, select, random.Next2());
      if (!sample) continue;
      ++found;
      ASSERT_TRUE(std::isfinite(sample->pdf) && sample->pdf > 0);
      ASSERT_NEAR(Length(sample->wi), 1, 1e-6);
      ASSERT_TRUE(std::isfinite(LengthSquared(ToDouble(sample->p_light))));
      bool same = false;
      for (uint32_t emitter = 0; emitter < 3; ++emitter) {
        same |= sample->pdf ==
                table->PdfEmitter<kAllTraits>(emitter, kOrigin, {}, sample->wi, sample->p_light);
      }
      ASSERT_TRUE(same);
    }
  }
  EXPECT_GT(found, 40000);
}

// --- L4: rectangles and disks in awkward places
// ----------------------------------------------------

TEST(LightStabilityTest, L4ReceiverInTheLightsPlaneGetsNothing) {
  LightTableInput input;
  input.triangles = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, kWhite, true}};
  input.disks = {{{5, 0, 0}, {0, 0, 1}, {1, 0, 0}, 1, 0, kWhite, true}};
  const auto table = MakeTable(input);
  RandomPoints random(41);
  for (const Vec3f& p :
       {Vec3f{0.2f, 0.2f, 0}, Vec3f{3, 3, 0}, Vec3f{0, 0, 0}, Vec3f{5, 0, 0}, Vec3f{0.5f, 0, 0}}) {
    for (int i = 0; i < 100; ++i) {
      EXPECT_FALSE(table->Sample<kAllTraits>(p, kUp, random.Next(), random.Next2()));
    }
    EXPECT_EQ(table->PdfEmitter<kAllTraits>(0, p, kUp, {1, 0, 0}, {0.3f, 0.3f, 0}), 0);
    EXPECT_EQ(table->PdfEmitter<kAllTraits>(1, p, kUp, {1, 0, 0}, {5.3f, 0.3f, 0}), 0);
  }
}

// A light a millionth above a plane still illuminates it: a huge triangle gives pi.
TEST(LightStabilityTest, L4LightAMillionthAboveAPlane) {
  LightTableInput input;
  input.triangles = {{{-1e3f, -1e3f, 1e-6f}, {0, 2e3f, 1e-6f}, {1e3f, -1e3f, 1e-6f}, kWhite}};
  ExpectNear(EstimateIrradiance(*MakeTable(input), kOrigin, kUp, 4096), kPi, 1e-5);
  LightTableInput disk;
  disk.disks = {{{0, 0, 1e-6}, {0, 0, -1}, {1, 0, 0}, 1, 0, kWhite}};
  ExpectNear(EstimateIrradiance(*MakeTable(disk), kOrigin, kUp, 4096), kPi, 1e-5);
}

// --- L5: delta lights --------------------------------------------------------------------------

// Power as the integral of intensity over directions, evaluated on a sphere of receivers around the
// light.
double PowerOf(const LightTable& table) {
  return EstimateMean(16384,
                      [&](const std::array<float, 4>& u) {
                        const Vec3d d = EqualAreaSquareToSphere({double{u[0]}, double{u[1]}});
                        const auto sample =
                            table.Sample<kAllTraits>(ToFloat(d * 2.0), {}, 0.5f, {0.5f, 0.5f});
                        return sample ? 4 * kPi * 4 * static_cast<double>(sample->radiance.r) : 0.0;
                      })
      .mean;
}

TEST(LightStabilityTest, L5PowerOfPointAndSpot) {
  LightDescription point = MakePoint(kWhite, {0, 0, 0});
  EXPECT_NEAR(PowerOf(*MakeTable({}, {point})), 4 * kPi, 1e-4);
  point.scale.power_w = 60;
  EXPECT_NEAR(PowerOf(*MakeTable({}, {point})), 60, 1e-4);
  LightDescription spot = MakeSpot(kWhite, {0, 0, 0}, {0.3, 1, -0.5}, 40, 15);
  const double c_end = std::cos(40 * kPi / 180), c_start = std::cos(25 * kPi / 180);
  EXPECT_NEAR(PowerOf(*MakeTable({}, {spot})), 2 * kPi * (1 - 0.5 * (c_start + c_end)), 2e-3);
  spot.scale.power_w = 100;
  EXPECT_NEAR(PowerOf(*MakeTable({}, {spot})), 100, 0.15);
}

TEST(LightStabilityTest, L5DeltaLightsStayFinite) {
  const auto table = MakeTable({}, {MakePoint(kWhite, {1, 2, 3})});
  const auto at_light = table->Sample<kAllTraits>({1, 2, 3}, {}, 0, {0, 0});
  EXPECT_FALSE(at_light);
  ExpectHardCase({.row = "L5",
                  .figure = "radiance from a point light at its own place",
                  .expected = 0,
                  .measured = at_light ? at_light->radiance.r : 0,
                  .naive = naive::InverseSquare(0),
                  .naive_by = "1 / r^2"});
  const auto near = table->Sample<kAllTraits>({1, 2, 3.0000002f}, {}, 0, {0, 0});
  ASSERT_TRUE(near.has_value());
  EXPECT_TRUE(near->is_delta && std::isfinite(near->radiance.r));
  EXPECT_EQ(near->pdf, 1);
  // A spot light with a hard edge: no division by the width of the falloff.
  const auto hard = MakeTable({}, {MakeSpot(kWhite, {0, 0, 0}, {0, 0, 1}, 30, 0)});
  EXPECT_TRUE(hard->Sample<kAllTraits>({0, 0.5f, 1}, {}, 0, {0, 0}));
  EXPECT_FALSE(hard->Sample<kAllTraits>({0, 0.6f, 1}, {}, 0, {0, 0}));
}

TEST(LightStabilityTest, L5DeltaLightsFollowTheirTransform) {
  LightDescription spot = MakeSpot(kWhite, {0, 0, 0}, {0, 0, 1}, 20, 5);
  // Moved, rotated towards -x, and mirrored; render space has its origin at (10, 0, 0).
  spot.world_from_light =
      TranslateMatrix({12, 3, 4}) * ScaleMatrix({-1, 1, 1}) * RotateMatrix(90, {0, 1, 0});
  LightTableInput input;
  input.render_origin_world = {10, 0, 0};
  const auto table = MakeTable(input, {spot});
  const auto sample = table->Sample<kAllTraits>({0, 3, 4}, {}, 0, {0, 0});
  ASSERT_TRUE(sample.has_value());
  EXPECT_NEAR(sample->wi.x, 1, 1e-6);
  EXPECT_NEAR(sample->radiance.r, 0.25, 1e-6);
  EXPECT_FALSE(table->Sample<kAllTraits>({4, 3, 4}, {}, 0, {0, 0}));
}

}  // namespace
}  // namespace sheaf::render
