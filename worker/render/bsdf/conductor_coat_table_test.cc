// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/conductor_coat_table.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <optional>
#include <vector>

#include "common/math/frame.h"
#include "gtest/gtest.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::CounterUniforms;
using sheaf::testing::DirectionAt;

struct Layers {
  float interface_alpha, base_alpha, eta, thickness, reflectance;
};
BsdfFixture CoatOf(const Layers& layers, bool keeps_energy = true) {
  return sheaf::testing::MakeConductorCoatFixture(
      {layers.interface_alpha, layers.interface_alpha}, {layers.base_alpha, layers.base_alpha},
      layers.eta, layers.thickness, layers.reflectance, keeps_energy);
}
BsdfFixture BaseOf(const Layers& layers, bool keeps_energy) {
  const float k = layers.reflectance >= 1
                      ? kPerfectConductorK
                      : 2 * std::sqrt(layers.reflectance / (1 - layers.reflectance));
  return sheaf::testing::MakeConductorFixture(layers.base_alpha, layers.base_alpha, Rgb::Gray(1),
                                              Rgb::Gray(k), keeps_energy);
}

// Energy that leaves, and its deviation from the mirror direction.
struct CoatEstimate {
  double mean = 0, error = 0;
  double cosine_to_mirror = 0;  // Averaged over the energy.
};
class EnergySum {
 public:
  explicit EnergySum(Vec3f wo) : mirror_{-wo.x, -wo.y, wo.z} {}
  void Add(double energy, Vec3f wi) {
    ++count_;
    sum_ += energy;
    sum_square_ += energy * energy;
    sum_cosine_ += energy * static_cast<double>(Dot(wi, mirror_));
  }
  CoatEstimate Finish() const {
    const double count = static_cast<double>(count_), mean = sum_ / count;
    const double variance = std::max(0.0, sum_square_ / count - mean * mean);
    return {mean, std::sqrt(variance / count), sum_cosine_ / sum_};
  }

 private:
  Vec3f mirror_;
  uint64_t count_ = 0;
  double sum_ = 0, sum_square_ = 0, sum_cosine_ = 0;
};

// Called with the energy that leaves, and its direction.
using LeavingLight = std::function<void(double, Vec3f)>;

// Simulates the layers: a random walk between interface and base, without a depth limit. Returns
// the fraction of the energy arriving along wo that leaves again.
CoatEstimate WalkThroughLayers(const Layers& layers, Vec3f wo, bool keeps_energy,
                               const LeavingLight& note = {}) {
  const uint64_t kWalks = note ? 300000 : 60000;
  constexpr uint64_t kStepsMax = 1000;
  const BsdfFixture interface = sheaf::testing::MakeDielectricFixture(
      layers.interface_alpha, layers.interface_alpha, layers.eta, keeps_energy);
  const BsdfFixture base = BaseOf(layers, keeps_energy);
  EnergySum sum(wo);
  for (uint64_t walk = 0; walk < kWalks; ++walk) {
    uint64_t draw = walk * kStepsMax;
    const auto scatter = [&](const Bsdf& bsdf, Vec3f w) {
      const auto u = CounterUniforms(31, draw++);
      return SampleBsdf<kAllTraits>(bsdf, w, u[0], {u[1], u[2]});
    };
    double energy = 1;
    auto sample = scatter(interface.bsdf, wo);
    while (true) {
      if (!sample) energy = 0;
      if (energy == 0) break;
      energy *= sample->weight.g * sample->eta_scale;
      if (sample->wi.z > 0) break;  // Left the coat.
      energy *= Exp(-static_cast<double>(layers.thickness) / -sample->wi.z);
      const auto up = scatter(base.bsdf, -sample->wi);
      if (!up) energy = 0;
      if (energy == 0) break;
      energy *= up->weight.g * Exp(-static_cast<double>(layers.thickness) / up->wi.z);
      sample = scatter(interface.bsdf, -up->wi);
    }
    sum.Add(energy, sample ? sample->wi : wo);
    if (note) note(energy, sample ? sample->wi : -wo);
  }
  return sum.Finish();
}

CoatEstimate EstimateCoatAlbedo(const Bsdf& coat, Vec3f wo) {
  constexpr uint64_t kDraws = 60000;
  EnergySum sum(wo);
  for (uint64_t i = 0; i < kDraws; ++i) {
    const auto u = CounterUniforms(33, i);
    const auto sample = SampleBsdf<kAllTraits>(coat, wo, u[0], {u[1], u[2]});
    sum.Add(sample ? sample->weight.g : 0, sample ? sample->wi : wo);
  }
  return sum.Finish();
}

void ExpectAgreement(const Layers& layers, float mu, bool keeps_energy, double tolerance) {
  SCOPED_TRACE(::testing::Message()
               << "interface " << layers.interface_alpha << " base " << layers.base_alpha << " eta "
               << layers.eta << " thickness " << layers.thickness << " reflectance "
               << layers.reflectance << " mu " << mu);
  const Vec3f wo = DirectionAt(mu, 1);
  const CoatEstimate walk = WalkThroughLayers(layers, wo, keeps_energy);
  const BsdfFixture coat = CoatOf(layers, keeps_energy);
  const CoatEstimate found = EstimateCoatAlbedo(coat.bsdf, wo);
  EXPECT_NEAR(found.mean, walk.mean, 4 * (walk.error + found.error) + tolerance * walk.mean);
  std::printf("ai %.2f ab %.2f mu %.2f: cos walk %.3f mine %.3f; albedo %.4f %.4f\n",
              layers.interface_alpha, layers.base_alpha, mu, walk.cosine_to_mirror,
              found.cosine_to_mirror, walk.mean, found.mean);
  EXPECT_NEAR(found.cosine_to_mirror, walk.cosine_to_mirror, 0.08);
}

TEST(ConductorCoatTableTest, MirrorsAreExact) {
  for (const float thickness : {0.0f, 0.3f}) {
    for (const float mu : {1.0f, 0.4f, 0.05f}) {
      ExpectAgreement({0, 0, 1.5f, thickness, 0.8f}, mu, true, 1e-6);
    }
  }
}

TEST(ConductorCoatTableTest, SmoothCoatMatchesRandomWalks) {
  const Layers cases[] = {{0, 0.05f, 1.5f, 0.01f, 0.9f},
                          {0, 0.1f, 1.5f, 0.01f, 0.95f},
                          {0, 0.3f, 1.5f, 0.01f, 0.5f},
                          {0, 0.6f, 2, 0.5f, 0.9f}};
  for (const Layers& layers : cases) {
    for (const float mu : {0.95f, 0.5f, 0.15f}) ExpectAgreement(layers, mu, true, 0.01);
  }
}

// Without returned energy both lose the same, at any roughness.
TEST(ConductorCoatTableTest, LossyRoughCoatMatchesLossyRandomWalks) {
  const Layers cases[] = {{0.1f, 0, 1.5f, 0.01f, 0.9f},    {0.3f, 0, 1.5f, 0.01f, 0.7f},
                          {0.3f, 0.3f, 1.5f, 0.01f, 0.9f}, {0.6f, 0.5f, 1.5f, 0.01f, 0.9f},
                          {0.1f, 0.1f, 2.0f, 0.01f, 0.7f}, {0.2f, 0.2f, 1.3f, 0.1f, 1}};
  for (const Layers& layers : cases) {
    for (const float mu : {0.95f, 0.5f, 0.15f}) ExpectAgreement(layers, mu, false, 0.015);
  }
}

// With it, the walk's interface returns part of its loss as reflection, the coat gives all of it to
// the base: for a bright base the results are nearly the same.
TEST(ConductorCoatTableTest, RoughCoatOverABrightBaseMatchesRandomWalks) {
  const Layers cases[] = {{0.1f, 0, 1.5f, 0.01f, 0.9f}, {0.3f, 0.3f, 1.5f, 0.01f, 0.9f}};
  for (const Layers& layers : cases) {
    for (const float mu : {0.95f, 0.3f}) ExpectAgreement(layers, mu, true, 0.015);
  }
}

// Narrow cones about the mirror direction and beside it, in the plane of incidence and across.
std::vector<Vec3f> ConesAboutMirror(double theta) {
  constexpr double kDegree = std::numbers::pi / 180, kStep = 7.5 * kDegree;
  const Vec3d mirror{-std::sin(theta), 0, std::cos(theta)};
  std::vector<Vec3f> axes;
  for (int i = -10; i <= 10; ++i) {
    const double in_plane = theta + i * kStep;
    for (const Vec3d axis : {Vec3d{-std::sin(in_plane), 0, std::cos(in_plane)},
                             mirror * std::cos(i * kStep) + Vec3d{0, 1, 0} * std::sin(i * kStep)}) {
      if (axis.z > 0.15) axes.push_back(ToFloat(axis));
    }
  }
  return axes;
}
const float kConeCosine = std::cos(3.75f * static_cast<float>(std::numbers::pi / 180));

// The energy that the coat scatters from wo into a cone.
double EnergyInCone(const Bsdf& coat, Vec3f wo, Vec3f axis) {
  constexpr int kRings = 12, kSides = 24;
  const Frame frame = Frame::FromNormal(axis);
  const double height = 1 - static_cast<double>(kConeCosine);
  double sum = 0;
  for (int i = 0; i < kRings; ++i) {
    for (int j = 0; j < kSides; ++j) {
      const double z = 1 - height * (i + 0.5) / kRings, r = std::sqrt(1 - z * z);
      const double phi = 2 * std::numbers::pi * (j + 0.5) / kSides;
      const Vec3f wi = frame.ToWorld(ToFloat(Vec3d{r * std::cos(phi), r * std::sin(phi), z}));
      sum += static_cast<double>(EvalBsdf<kAllTraits>(coat, wo, wi).f_cos.g);
    }
  }
  return sum * 2 * std::numbers::pi * height / (kRings * kSides);
}

// Rough over sharp, sharp over rough, and alike: the shape of the highlight. Most of its light lies
// where the walk has more than half of its peak.
TEST(ConductorCoatTableTest, HighlightsHaveTheShapeOfRandomWalks) {
  const Layers cases[] = {{0.141f, 0.045f, 1.5f, 0.01f, 0.9f},
                          {0.3f, 0.1f, 1.5f, 0.01f, 0.9f},
                          {0.05f, 0.3f, 1.5f, 0.01f, 0.9f},
                          {0.1f, 0.1f, 1.5f, 0.01f, 0.9f}};
  for (const Layers& layers : cases) {
    const BsdfFixture coat = CoatOf(layers);
    for (const double degrees : {0.0, 30.0, 60.0}) {
      const double theta = degrees * std::numbers::pi / 180;
      const Vec3f wo = ToFloat(Vec3d{std::sin(theta), 0, std::cos(theta)});
      const std::vector<Vec3f> axes = ConesAboutMirror(theta);
      std::vector<double> walk(axes.size());
      uint64_t walks = 0;
      WalkThroughLayers(layers, wo, true, [&](double energy, Vec3f wi) {
        ++walks;
        for (size_t i = 0; i < axes.size(); ++i) {
          if (Dot(axes[i], wi) > kConeCosine) walk[i] += energy;
        }
      });
      for (double& energy : walk) energy /= static_cast<double>(walks);
      const double peak = *std::max_element(walk.begin(), walk.end());
      for (size_t i = 0; i < axes.size(); ++i) {
        if (walk[i] < 0.01 * peak) continue;
        const double tolerance = walk[i] > 0.5 * peak ? 0.18 : walk[i] > 0.1 * peak ? 0.3 : 0.5;
        EXPECT_NEAR(EnergyInCone(coat.bsdf, wo, axes[i]) / walk[i], 1, tolerance)
            << "interface " << layers.interface_alpha << " base " << layers.base_alpha << " at "
            << degrees << " degrees, towards " << axes[i].x << ' ' << axes[i].y;
      }
    }
  }
}

TEST(ConductorCoatTableTest, WhiteBaseHasWhiteTint) {
  const ConductorCoatRow row = MakeConductorCoatRow({0.2f, 0.2f}, {0.3f, 0.3f}, 1.5f, 0);
  EXPECT_NEAR(row.Tint(1), 1, 1e-4);
  EXPECT_EQ(row.Tint(0), 0);
  for (int i = 0; i < 100; ++i) {
    const float r = static_cast<float>(i) / 100;
    EXPECT_LE(row.Tint(r), row.Tint(r + 0.01f)) << r;
    EXPECT_LE(row.Tint(r), r);  // The rest has been reflected at the base at least once.
  }
}

TEST(ConductorCoatTableTest, IndexOneKeepsTheConductor) {
  for (const float alpha : {0.1f, 0.4f}) {
    const Layers layers{0, alpha, 1, 0, 0.6f};
    const BsdfFixture coat = CoatOf(layers), bare = BaseOf(layers, false);
    for (uint64_t i = 0; i < 200; ++i) {
      const auto u = CounterUniforms(9, i), v = CounterUniforms(10, i);
      const Vec3f a = DirectionAt(0.05f + 0.95f * u[0], 6.2f * u[1]);
      const Vec3f b = DirectionAt(0.05f + 0.95f * v[0], 6.2f * v[1]);
      const float expected = EvalBsdf<kAllTraits>(bare.bsdf, a, b).f_cos.g;
      // Beyond single scattering, both return the lost energy in a similar way.
      EXPECT_GE(EvalBsdf<kAllTraits>(coat.bsdf, a, b).f_cos.g, expected * (1 - 1e-4f));
    }
    const BsdfFixture kept = BaseOf(layers, true);
    for (const float mu : {0.9f, 0.4f}) {
      const CoatEstimate with = EstimateCoatAlbedo(coat.bsdf, DirectionAt(mu, 1));
      const CoatEstimate without = EstimateCoatAlbedo(kept.bsdf, DirectionAt(mu, 1));
      EXPECT_NEAR(with.mean, without.mean, 4 * (with.error + without.error) + 5e-3);
    }
  }
}

}  // namespace
}  // namespace sheaf::render
