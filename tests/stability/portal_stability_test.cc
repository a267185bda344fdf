// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Portals: the sky through a rectangle, estimated by light samples and by rays that reach the sky,
// against closed forms, and at points where the view of the rectangle degenerates.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/chi_square.h"
#include "tests/support/light_tables.h"
#include "tests/support/temporary_path.h"
#include "worker/render/light/sky_portal.h"

namespace sheaf::render {
namespace {

using testing::Estimate;
using testing::EstimateIrradiance;
using testing::EstimateMean;
using testing::RandomPoints;

constexpr Vec3f kAbove{0, 0, 1};

// In the plane z = 1; light comes from above.
const Vec3d kCorners[4] = {{-1, -0.5, 1}, {-1, 2, 1}, {0.5, 2, 1}, {0.5, -0.5, 1}};

// Irradiance through the polygon under a sky of radiance 1, with all of the polygon above the
// horizon of n. Source: Lambert 1760, as in Arvo 1995, eq. 2.7.
double LambertIrradiance(Vec3d p, Vec3d n) {
  double sum = 0;
  for (size_t i = 0; i < 4; ++i) {
    const Vec3d a = Normalize(kCorners[i] - p), b = Normalize(kCorners[(i + 1) % 4] - p);
    const Vec3d edge = Cross(a, b);
    sum += std::atan2(Length(edge), Dot(a, b)) * Dot(n, edge) / Length(edge);
  }
  return std::fabs(sum) / 2;
}

// A light with a Gaussian profile low in the sky, plus a constant sky.
double LightAndSky(Vec3f d) {
  const Vec3f off = d - Normalize(Vec3f{0.5f, 0.3f, 0.6f});
  return 1 + 200 * std::exp(-static_cast<double>(LengthSquared(off)) * 60);
}

class PortalStabilityTest : public ::testing::Test {
 protected:
  std::unique_ptr<LightTable> MakeTable(int size, const std::vector<Rgb>& texels,
                                        double scale = 1) {
    const std::string path = sheaf::testing::TemporaryPath("sky.pfm");
    testing::WritePfm(path, size, texels);
    InfiniteLight infinite;
    infinite.file = "sky.pfm";
    for (const Vec3d& corner : kCorners) infinite.portal.push_back(corner * scale);
    LightDescription light;
    light.light = infinite;
    SceneDescription scene;
    scene.lights = {light};
    TableFileSource files({{"sky.pfm", path}});
    auto table = LightTable::Build(scene, {}, files);
    SHEAF_CHECK(table.ok());
    std::filesystem::remove(path);
    return std::move(*table);
  }
};

// Estimated by rays to the sky in all directions of the hemisphere.
Estimate EscapedIrradiance(const LightTable& table, Vec3f p, uint64_t points_per_replicate) {
  return EstimateMean(points_per_replicate, [&](const std::array<float, 4>& u) {
    const double z = static_cast<double>(u[0]), r = std::sqrt(1 - z * z);
    const SinCosPair<double> phi = SinCos(2 * kPi * static_cast<double>(u[1]));
    const Vec3f d = ToFloat({r * phi.cos, r * phi.sin, z});
    return 2 * kPi * z * static_cast<double>(table.EnvironmentRadiance<kAllTraits>(p, d).r);
  });
}

TEST_F(PortalStabilityTest, ConstantSkyMatchesLambertsFormula) {
  const auto table = MakeTable(1, {testing::kWhite});
  for (const Vec3f& p : {Vec3f{0, 0, 0}, Vec3f{3, -1, 0.2f}, Vec3f{0, 0, 0.99f},
                         Vec3f{0.1f, 0.2f, 0.99999f}, Vec3f{-40, 7, -3}, Vec3f{0, 0, -1e4f}}) {
    const double expected = LambertIrradiance(ToDouble(p), {0, 0, 1});
    testing::ExpectNear(EstimateIrradiance(*table, p, kAbove), expected, 1e-5);
    // Rays alone do not find a distant window.
    if (expected > 0.05) {
      testing::ExpectNear(EscapedIrradiance(*table, p, 1 << 14), expected, 1e-4);
    }
  }
  // On a tilted surface.
  const Vec3d n = Normalize(Vec3d{0.2, -0.1, 1});
  testing::ExpectNear(EstimateIrradiance(*table, {}, ToFloat(n)), LambertIrradiance({}, n), 1e-5);
}

TEST_F(PortalStabilityTest, SamplesAndEscapedRaysAgree) {
  std::vector<Rgb> texels;
  RandomPoints random(3);
  for (int i = 0; i < 32 * 32; ++i) {
    texels.push_back(Rgb::Gray(random.Next() < 0.02f ? 100.0f : random.Next()));
  }
  const auto table = MakeTable(32, texels);
  for (const Vec3f& p : {Vec3f{0, 0, 0}, Vec3f{0.3f, 1.5f, 0.7f}, Vec3f{1, 0, 0.5f}}) {
    const Estimate sampled = EstimateIrradiance(*table, p, kAbove, 1 << 12);
    const Estimate escaped = EscapedIrradiance(*table, p, 1 << 15);
    EXPECT_NEAR(sampled.mean, escaped.mean,
                6 * std::hypot(sampled.standard_error, escaped.standard_error));
    // The rays use eight times as many points.
    EXPECT_LT(sampled.standard_error, escaped.standard_error);
    int count = 0, same = 0;
    for (int i = 0; i < 4000; ++i) {
      const auto sample = table->Sample<kAllTraits>(p, kAbove, random.Next(), random.Next2());
      if (!sample) continue;
      ++count;
      const EnvironmentValue value = table->EvalEnvironment<kAllTraits>(p, kAbove, sample->wi);
      const float ratio = value.pdf / sample->pdf;
      same += ratio > 0.9999f && ratio < 1.0001f && value.radiance == sample->radiance;
    }
    // Except those that rounding moves across the edge of a cell or of the window.
    EXPECT_GT(count, 3900);
    EXPECT_GT(same, count - 8);
  }
}

TEST_F(PortalStabilityTest, NoLightInOrBehindThePlane) {
  const auto table = MakeTable(1, {testing::kWhite});
  RandomPoints random(4);
  for (const Vec3f& p : {Vec3f{0, 0, 1}, Vec3f{5, 5, 1}, Vec3f{-1, -0.5f, 1}, Vec3f{0, 0, 2},
                         Vec3f{0, 0, 1.0000001f}}) {
    for (int i = 0; i < 100; ++i) {
      EXPECT_FALSE(table->Sample<kAllTraits>(p, {}, random.Next(), random.Next2()));
    }
    for (const Vec3f& d : {kAbove, -kAbove, Normalize(Vec3f{1, 2, 0.1f})}) {
      EXPECT_EQ(table->EnvironmentRadiance<kAllTraits>(p, d), Rgb{});
      EXPECT_EQ(table->PdfEnvironment<kAllTraits>(p, {}, d), 0);
    }
  }
  // Rays straight through the portal, beside it, and away from it.
  EXPECT_EQ(table->EnvironmentRadiance<kAllTraits>({}, kAbove).r, 1);
  EXPECT_EQ(table->EnvironmentRadiance<kAllTraits>({0.6f, 0, 0}, kAbove).r, 0);
  EXPECT_EQ(table->EnvironmentRadiance<kAllTraits>({}, -kAbove).r, 0);
}

// The closer a point is to the plane and the farther to the side, the smaller the solid angle of
// the portal, down to zero.
TEST_F(PortalStabilityTest, GrazingSamplesAreFiniteAndInTheWindow) {
  const SkyPortal portal(kCorners, 256, 1 + 1e-3, LightAndSky);
  RandomPoints random(5);
  int count = 0;
  for (int exponent = 1; exponent <= 24; ++exponent) {
    const float depth = std::ldexp(1.0f, -exponent);
    for (const Vec2f& at :
         {Vec2f{0, 0}, Vec2f{0.5f, 0}, Vec2f{7, 0.5f}, Vec2f{-1, -0.5f}, Vec2f{1e4f, -1e4f}}) {
      const Vec3f p{at.x, at.y, 1 - depth};
      for (int i = 0; i < 50; ++i) {
        const SkyPortal::Sample sample = portal.SampleFrom(p, random.Next2());
        if (!(sample.pdf > 0)) continue;
        ++count;
        ASSERT_TRUE(std::isfinite(sample.pdf));
        ASSERT_NEAR(Length(sample.d), 1, 1e-6);
        ASSERT_GE(sample.d.z, 0);
        if (sample.d.z < 1e-3f) continue;
        const Vec3d d = ToDouble(sample.d);
        const Vec3d at_window = ToDouble(p) + d * ((1 - static_cast<double>(p.z)) / d.z);
        const double room = 1e-5 * (1 + Length(at_window - ToDouble(p))) / d.z;
        ASSERT_TRUE(at_window.x >= -1 - room && at_window.x <= 0.5 + room &&
                    at_window.y >= -0.5 - room && at_window.y <= 2 + room);
      }
    }
  }
  EXPECT_GT(count, 3000);
}

// From the center, from the side, from right below the plane, and from afar.
TEST_F(PortalStabilityTest, SamplesPassChiSquareAndThePdfSumsToOne) {
  constexpr int kCells = 16, kPointsAcross = 48, kDraws = 200000;
  const Vec3f points[] = {{0, 0, 0}, {3, 1, 0.3f}, {0.2f, 0.3f, 0.98f}, {-20, -30, -40}};
  const SkyPortal portal(kCorners, 64, 1.5, LightAndSky);
  const double threshold = sheaf::testing::SidakThreshold(0.01, 4);
  for (const Vec3f& p : points) {
    const Vec3d to_lower = kCorners[0] - ToDouble(p), to_upper = kCorners[2] - ToDouble(p);
    const double x0 = std::atan2(to_lower.x, to_lower.z), x1 = std::atan2(to_upper.x, to_upper.z);
    const double y0 = std::atan2(to_lower.y, to_lower.z), y1 = std::atan2(to_upper.y, to_upper.z);
    std::vector<double> expected(kCells * kCells), observed(kCells * kCells);
    const double step_x = (x1 - x0) / (kCells * kPointsAcross);
    const double step_y = (y1 - y0) / (kCells * kPointsAcross);
    double total = 0;
    for (int j = 0; j < kCells * kPointsAcross; ++j) {
      for (int i = 0; i < kCells * kPointsAcross; ++i) {
        const double tx = std::tan(x0 + (i + 0.5) * step_x), ty = std::tan(y0 + (j + 0.5) * step_y);
        const Vec3d d = Normalize(Vec3d{tx, ty, 1});
        const double part = static_cast<double>(portal.Pdf(p, ToFloat(d))) * (1 - d.x * d.x) *
                            (1 - d.y * d.y) / d.z * step_x * step_y;
        expected[static_cast<size_t>(j / kPointsAcross * kCells + i / kPointsAcross)] += part;
        total += part;
      }
    }
    EXPECT_NEAR(total, 1, 5e-3);  // The midpoint rule does not follow the table's edges.
    for (int i = 0; i < kDraws; ++i) {
      const auto u = sheaf::testing::CounterUniforms(31, static_cast<uint64_t>(i));
      const SkyPortal::Sample sample = portal.SampleFrom(p, {u[0], u[1]});
      ASSERT_GT(sample.pdf, 0);
      const Vec3d d = ToDouble(sample.d);
      const auto cell = [&](double angle, double lower, double upper) {
        const double t = (angle - lower) / (upper - lower) * kCells;
        return static_cast<size_t>(std::clamp(static_cast<int>(t), 0, kCells - 1));
      };
      observed[cell(std::atan2(d.y, d.z), y0, y1) * kCells + cell(std::atan2(d.x, d.z), x0, x1)] +=
          1;
    }
    double chi_square = 0;
    for (size_t i = 0; i < expected.size(); ++i) {
      const double e = expected[i] / total * kDraws;
      chi_square += (observed[i] - e) * (observed[i] - e) / e;
    }
    const double p_value = sheaf::testing::UpperGammaQ((kCells * kCells - 1) / 2.0, chi_square / 2);
    EXPECT_GT(p_value, threshold) << p.x << " " << p.y << " " << p.z;
  }
}

TEST_F(PortalStabilityTest, ScaleByAPowerOfTwoChangesNoBit) {
  std::vector<Rgb> texels;
  for (int i = 0; i < 64; ++i) texels.push_back(Rgb::Gray(static_cast<float>(1 + i % 5)));
  const auto table = MakeTable(8, texels);
  for (double scale : {0x1p-20, 0x1p20}) {
    const auto scaled = MakeTable(8, texels, scale);
    RandomPoints random(6);
    for (int i = 0; i < 500; ++i) {
      const Vec3f p{random.Next(), random.Next(), random.Next()};
      const Vec2f u = random.Next2();
      const auto a = table->Sample<kAllTraits>(p, kAbove, 0, u);
      const auto b = scaled->Sample<kAllTraits>(p * static_cast<float>(scale), kAbove, 0, u);
      ASSERT_EQ(a.has_value(), b.has_value());
      if (!a) continue;
      ASSERT_EQ(a->wi, b->wi);
      ASSERT_EQ(a->pdf, b->pdf);
      ASSERT_EQ(a->radiance, b->radiance);
    }
  }
}

}  // namespace
}  // namespace sheaf::render
