// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests what the rays that leave lights carry, for every kind of light. Their flux is the light's
// power, known in closed form or by quadrature of the radiance that arrives. Their flux through a
// rectangle is what LightTable::Sample finds there. Estimates have 16 replicates and are compared
// within six standard errors (two-sided 2.4e-5 for Student's t); the seeds are fixed.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/light_setups.h"
#include "tests/support/light_tables.h"
#include "tests/support/long_tests.h"
#include "worker/render/light/light_emission.h"
#include "worker/render/light/light_table_impl.h"
#include "worker/render/light/photometric_web.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

using testing::EmissionOf;
using testing::Estimate;
using testing::kSetupRadius;
using testing::kWhite;
using testing::LightSetup;
using testing::LightSetups;
using testing::MakeTable;
using testing::NextUniforms;
using testing::RandomPoints;

// The mean of f over emitted rays; f is 0 where there is none.
Estimate MeanOverRays(const LightEmission& emission, const std::function<double(EmittedRay)>& f) {
  const uint64_t count = static_cast<uint64_t>(DrawCount(4096, 65536)) * kReplicateCount;
  std::array<double, kReplicateCount> sums{};
  for (uint64_t i = 0; i < count; ++i) {
    const Sampler sampler(20261101, 3, 5, i);
    const std::array<float, 4> u = sampler.Get4(1);
    const auto ray = emission.SampleLe({sampler.Get1(2), {u[0], u[1]}, {u[2], u[3]}});
    if (ray) sums[ReplicateOf(i)] += f(*ray);
  }
  Estimate estimate;
  const double per_replicate = static_cast<double>(count) / kReplicateCount;
  for (const double sum : sums) estimate.mean += sum / static_cast<double>(count);
  for (const double sum : sums) {
    const double off = sum / per_replicate - estimate.mean;
    estimate.standard_error += off * off;
  }
  estimate.standard_error =
      std::sqrt(estimate.standard_error / (kReplicateCount * (kReplicateCount - 1)));
  return estimate;
}

double RedFlux(const EmittedRay& ray) { return static_cast<double>(ray.power.r) / ray.pdf; }

// The estimate is also precise: an estimator with a few large samples would pass by chance.
void ExpectPrecise(const Estimate& estimate, double expected, double tolerance) {
  testing::ExpectNear(estimate, expected, tolerance);
  EXPECT_LT(estimate.standard_error, 0.02 * std::fabs(expected));
}

// --- Power -------------------------------------------------------------------------------------

TEST(LightEmissionTest, SurfacesEmitTheirArea) {
  const LightSetups setups;
  const auto area = [](const std::string& name) {
    const double sides = name.starts_with("two-sided") ? 2 : 1;
    if (name.ends_with("triangle")) {
      const TriangleEmitter t = LightSetups().Triangle(false);
      return sides * 0.5 * Length(Cross(ToDouble(t.v1 - t.v0), ToDouble(t.v2 - t.v0)));
    }
    if (name == "inward sphere") return 4 * kPi * 2.5 * 2.5;
    if (name.ends_with("sphere")) return sides * 4 * kPi * 0.4 * 0.4;
    if (name == "ring") return kPi * (0.6 * 0.6 - 0.4 * 0.4);
    return sides * kPi * 0.6 * 0.6;
  };
  int compared = 0;
  for (const LightSetup& setup : setups.Surfaces()) {
    SCOPED_TRACE(setup.name);
    const LightEmission emission = EmissionOf(setup);
    const Estimate flux = MeanOverRays(emission, RedFlux);
    if (setup.name == "textured triangle") {
      // The mean of the image over the triangle, by the midpoints of small squares of (u, v).
      const LightTable::Impl& impl = setup.table->impl();
      const EmissionDetail& detail = impl.details[0];
      double mean = 0;
      constexpr int kFine = 1000;
      for (int i = 0; i < kFine; ++i) {
        for (int j = 0; j < kFine - i; ++j) {
          const float b1 = (static_cast<float>(i) + 1.0f / 3) / kFine;
          const float b2 = (static_cast<float>(j) + 1.0f / 3) / kFine;
          const Vec2f uv = detail.uv[0] + b1 * (detail.uv[1] - detail.uv[0]) +
                           b2 * (detail.uv[2] - detail.uv[0]);
          mean += static_cast<double>(impl.maps[0]->At(uv).r) * (i + j == kFine - 1 ? 0.5 : 1);
        }
      }
      mean *= 3 * 2.0 / (double{kFine} * kFine);
      ExpectPrecise(flux, kPi * area("triangle") * mean, 2e-3);
    } else {
      ExpectPrecise(flux, kPi * area(setup.name), 1e-5);
      EXPECT_NEAR(emission.power() / (kPi * area(setup.name)), 1, 1e-6);
      ++compared;
    }
  }
  EXPECT_EQ(compared, 8);
}

Vec3d PositionOf(const DeltaLight& light) {
  return std::visit(
      [](const auto& kind) {
        if constexpr (std::decay_t<decltype(kind)>::kIsDistant) {
          return Vec3d{};
        } else {
          return kind.position;
        }
      },
      light);
}

// The intensities that LightTable::Sample sees, integrated over all directions.
TEST(LightEmissionTest, LightsWithAPositionEmitTheirIntensity) {
  const LightSetups setups;
  for (const LightSetup& setup : setups.Positions()) {
    SCOPED_TRACE(setup.name);
    const Vec3d at = PositionOf(setup.table->impl().deltas[0]);
    constexpr int kFine = 800;
    double expected = 0;
    for (int y = 0; y < kFine; ++y) {
      for (int x = 0; x < kFine; ++x) {
        const Vec3d d = EqualAreaSquareToSphere({(x + 0.5) / kFine, (y + 0.5) / kFine});
        const auto sample =
            setup.table->Sample<kAllTraits>(ToFloat(at + 2 * d), {}, 0.5f, {0.5f, 0.5f});
        if (sample) expected += 4 * static_cast<double>(sample->radiance.r);
      }
    }
    expected *= 4 * kPi / (double{kFine} * kFine);
    ExpectPrecise(MeanOverRays(EmissionOf(setup), RedFlux), expected, 3e-3);
  }
}

TEST(LightEmissionTest, LightsAtInfinityFillTheSphere) {
  const LightSetups setups;
  const double disk = kPi * kSetupRadius * kSetupRadius;
  for (const LightSetup& setup : setups.Infinite()) {
    SCOPED_TRACE(setup.name);
    const LightEmission emission = EmissionOf(setup);
    const Estimate flux = MeanOverRays(emission, RedFlux);
    if (setup.name == "distant") {
      ExpectPrecise(flux, 2 * disk, 1e-5);
      continue;
    }
    // The power of the whole sky, and of the part that falls through the portal.
    double sky = 0, portal = 0;
    constexpr int kFine = 1000;
    const Vec3d along_x = testing::kPortalCorners[3] - testing::kPortalCorners[0];
    const Vec3d along_y = testing::kPortalCorners[1] - testing::kPortalCorners[0];
    const Vec3d facing = Cross(along_x, along_y);
    const InfiniteEmitter& light = setup.table->impl().infinites.back();
    for (int y = 0; y < kFine; ++y) {
      for (int x = 0; x < kFine; ++x) {
        const Vec3d d = EqualAreaSquareToSphere({(x + 0.5) / kFine, (y + 0.5) / kFine});
        Rgb radiance = light.radiance.rgb;
        if (light.map) {
          const Vec3f w = ToFloat(d);
          radiance = light.map->Radiance(Vec3f{Dot(light.light_from_render[0], w),
                                               Dot(light.light_from_render[1], w),
                                               Dot(light.light_from_render[2], w)});
        }
        sky += static_cast<double>(radiance.r);
        portal += static_cast<double>(radiance.r) * std::max(0.0, Dot(d, facing));
      }
    }
    const double each = 4 * kPi / (double{kFine} * kFine);
    const double expected = setup.name == "portal"      ? portal * each
                            : setup.name == "two skies" ? (portal + sky * disk) * each
                                                        : sky * each * disk;
    ExpectPrecise(flux, expected, 2e-3);
  }
}

// --- Flux through a rectangle ------------------------------------------------------------------

// From `corner` along the edges; receives on the side of their cross product.
struct Receiver {
  Vec3d corner, edge_x, edge_y;
  Vec3d Across() const { return Cross(edge_x, edge_y); }
};

// ends_inside: what a closed surface sends inwards stays there.
Estimate FluxByRays(const LightEmission& emission, const Receiver& receiver, bool ends_inside) {
  return MeanOverRays(emission, [&](const EmittedRay& ray) {
    if (ends_inside && Dot(ray.n, ray.w) < 0) return 0.0;
    const Vec3d across = receiver.Across(), w = ToDouble(ray.w);
    const double facing = Dot(w, across);
    if (!(facing < 0)) return 0.0;
    const double t = Dot(receiver.corner - ToDouble(ray.p), across) / facing;
    if (!(t > 0)) return 0.0;
    const Vec3d p = ToDouble(ray.p) + t * w, off = p - receiver.corner;
    const double x = Dot(off, receiver.edge_x) / LengthSquared(receiver.edge_x);
    const double y = Dot(off, receiver.edge_y) / LengthSquared(receiver.edge_y);
    if (!(x >= 0 && x < 1 && y >= 0 && y < 1)) return 0.0;
    if (!(emission.PdfLe(ray.light, ToFloat(p), ray.n, ray.w) > 0)) return 0.0;
    return RedFlux(ray);
  });
}

Estimate FluxByReceivers(const LightTable& table, const Receiver& receiver) {
  const Vec3d across = receiver.Across();
  const double area = Length(across);
  const Vec3f n = ToFloat(across / area);
  return testing::EstimateMean(4096, [&](const std::array<float, 4>& u) {
    const Vec3d p =
        receiver.corner + double{u[0]} * receiver.edge_x + double{u[1]} * receiver.edge_y;
    RandomPoints random(static_cast<uint64_t>(double{u[2]} * 0x1p24) * 7919 + 1);
    const auto sample = table.Sample<kAllTraits>(ToFloat(p), n, u[3], {u[2], random.Next()});
    if (!sample) return 0.0;
    const double cosine = Dot(ToDouble(sample->wi), ToDouble(n));
    return cosine > 0 ? area * double{sample->radiance.r} * cosine / double{sample->pdf} : 0.0;
  });
}

TEST(LightEmissionTest, RaysCarryWhatReceiversSample) {
  const LightSetups setups;
  // Tilted, below the lights and inside of the sphere that faces inwards.
  const Receiver receiver{{-0.8, -0.7, 0.1}, {1.4, 0.2, 0.1}, {-0.15, 1.26, -0.42}};
  ASSERT_NEAR(Dot(receiver.edge_x, receiver.edge_y), 0, 1e-12);
  std::vector<LightSetup> all = setups.Surfaces();
  for (LightSetup& setup : setups.Positions()) all.push_back(std::move(setup));
  for (LightSetup& setup : setups.Infinite()) all.push_back(std::move(setup));
  all.push_back(setups.Mixture());
  int lit = 0;
  for (const LightSetup& setup : all) {
    SCOPED_TRACE(setup.name);
    const Estimate rays = FluxByRays(EmissionOf(setup), receiver, setup.name == "two-sided sphere");
    const Estimate receivers = FluxByReceivers(*setup.table, receiver);
    const double error = std::hypot(rays.standard_error, receivers.standard_error);
    EXPECT_NEAR(rays.mean, receivers.mean, 6 * error + 1e-5 * receivers.mean);
    EXPECT_LT(error, 0.08 * receivers.mean);
    lit += receivers.mean > 0;
  }
  EXPECT_EQ(static_cast<size_t>(lit), all.size());
}

// Rays start before everything that their light reaches.
TEST(LightEmissionTest, RaysFromInfinityStartOutside) {
  const LightSetups setups;
  RandomPoints random(31);
  for (const LightSetup& setup : setups.Infinite()) {
    SCOPED_TRACE(setup.name);
    const LightEmission emission = EmissionOf(setup);
    for (int i = 0; i < 10000; ++i) {
      const auto ray = emission.SampleLe(NextUniforms(&random));
      if (!ray) continue;
      ASSERT_TRUE(ray->is_infinite);
      // At most on the plane that touches the sphere.
      ASSERT_LE(Dot(ToDouble(ray->p), ToDouble(ray->w)), -kSetupRadius);
    }
  }
}

// --- Hard cases --------------------------------------------------------------------------------

// Scaling lengths by powers of two changes exponents only: the same directions to the bit, points
// scaled, and densities divided by the area where they are per area.
TEST(LightEmissionTest, RaysAreScaleInvariant) {
  const LightSetups unit;
  const std::vector<LightSetup> surfaces = unit.Surfaces(), positions = unit.Positions(),
                                infinite = unit.Infinite();
  for (const double scale : {0x1p-20, 0x1p20}) {
    const LightSetups scaled(scale);
    const auto expect_same = [&](const std::vector<LightSetup>& at_one,
                                 const std::vector<LightSetup>& at_scale, bool per_area) {
      for (size_t k = 0; k < at_one.size(); ++k) {
        SCOPED_TRACE(at_one[k].name);
        const LightEmission one = EmissionOf(at_one[k]);
        const LightEmission other(*at_scale[k].table, {0, 0, 0}, kSetupRadius * scale);
        RandomPoints random(5);
        int rays = 0;
        for (int i = 0; i < 2000; ++i) {
          const EmissionUniforms u = NextUniforms(&random);
          const auto a = one.SampleLe(u), b = other.SampleLe(u);
          ASSERT_EQ(a.has_value(), b.has_value());
          if (!a) continue;
          ++rays;
          ASSERT_EQ(a->w, b->w);
          ASSERT_EQ(a->p * static_cast<float>(scale), b->p);
          ASSERT_EQ(a->power, b->power);
          ASSERT_EQ(a->pdf, b->pdf * (per_area ? scale * scale : 1));
        }
        EXPECT_GT(rays, 500);
      }
    };
    expect_same(surfaces, scaled.Surfaces(), true);
    expect_same(positions, scaled.Positions(), false);
    // The two skies of the last setup have powers of the same measure.
    expect_same(infinite, scaled.Infinite(), true);
  }
}

// Small, thin and distant lights keep their power.
TEST(LightEmissionTest, DegenerateLightsKeepTheirPower) {
  LightTableInput input;
  input.triangles = {{{1e6f, 0, 0}, {1e6f, 1, 0}, {1e6f, 0, 1}, kWhite, false},
                     {{0, 0, 0}, {1, 0, 0}, {1, 1e-6f, 0}, Rgb{1e6f, 0, 0}, true}};
  input.spheres = {{{0, 0, 1e5}, 1e-3, Rgb{2e5f, 0, 0}, false, false}};
  const auto table = MakeTable(std::move(input));
  const LightEmission emission(*table, {}, 1);
  ExpectPrecise(MeanOverRays(emission, RedFlux), kPi * (0.5 + 1 + 4 * kPi * 1e-6 * 2e5), 1e-5);
}

TEST(LightEmissionTest, LightsWithoutPowerAreNotChosen) {
  EXPECT_TRUE(LightEmission(*MakeTable({}), {}, 1).empty());
  EXPECT_FALSE(LightEmission(*MakeTable({}), {}, 1).SampleLe({}).has_value());
  // Nothing to illuminate.
  EXPECT_TRUE(LightEmission(*MakeTable({}, {testing::MakeSky(kWhite)}), {}, 0).empty());
  LightTableInput input;
  input.triangles = {{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, kWhite, true},
                     {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, Rgb{}, true},
                     {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, kWhite, false}};
  const auto table = MakeTable(std::move(input));
  const LightEmission emission(*table, {}, 1);
  RandomPoints random(3);
  for (int i = 0; i < 1000; ++i) {
    const auto ray = emission.SampleLe(NextUniforms(&random));
    ASSERT_TRUE(ray.has_value());
    ASSERT_EQ(ray->light, 2u);
    ASSERT_GT(ray->w.z, 0);
  }
  EXPECT_EQ(emission.PdfLe(0, {}, {0, 0, 1}, {0, 0, 1}), 0);
  EXPECT_EQ(emission.PdfLe(1, {}, {0, 0, 1}, {0, 0, 1}), 0);
  EXPECT_EQ(emission.PdfLe(2, {}, {0, 0, 1}, {0, 0, -1}), 0);
}

TEST(LightEmissionTest, SpectralRaysFollowTheSameDensities) {
  const LightSetups setups;
  for (const LightSetup& setup : setups.Positions()) {
    SCOPED_TRACE(setup.name);
    const LightEmission emission = EmissionOf(setup);
    RandomPoints random(9);
    for (int i = 0; i < 1000; ++i) {
      const EmissionUniforms u = NextUniforms(&random);
      const auto rgb = emission.SampleLe(u);
      const auto spectral = emission.SampleLe<Spectral>(u, Wavelengths::Sample(random.Next()));
      if (!rgb || !spectral) continue;
      ASSERT_EQ(rgb->w, spectral->w);
      ASSERT_EQ(rgb->pdf, spectral->pdf);
    }
  }
}

}  // namespace
}  // namespace sheaf::render
