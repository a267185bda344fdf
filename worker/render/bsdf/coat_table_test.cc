// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/coat_table.h"

#include <cmath>

#include "gtest/gtest.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"
#include "worker/render/bsdf/made_tables.h"

namespace sheaf::render {
namespace {

using sheaf::testing::CounterUniforms;

struct Estimate {
  double mean = 0, error = 0;
};

// Simulates the layers: a random walk between interface and base, without a depth limit. Returns
// the fraction of the energy arriving along wo that leaves again.
Estimate WalkThroughCoat(const Bsdf& interface, Vec3f wo, float thickness, float rho) {
  constexpr uint64_t kWalks = 200000;
  constexpr uint64_t kStepsMax = 1000;
  double sum = 0, sum_square = 0;
  for (uint64_t walk = 0; walk < kWalks; ++walk) {
    uint64_t draw = walk * kStepsMax;
    const auto scatter = [&](Vec3f w) {
      const auto u = CounterUniforms(21, draw++);
      return SampleBsdf<kAllTraits>(interface, w, u[0], {u[1], u[2]});
    };
    double energy = 1;
    auto sample = scatter(wo);
    while (true) {
      if (!sample) energy = 0;
      if (energy == 0) break;
      energy *= sample->weight.g * sample->eta_scale;
      if (sample->wi.z > 0) break;  // Left the coat.
      energy *= rho * Exp(-thickness / -sample->wi.z);
      const auto u = CounterUniforms(22, draw++);
      const Vec3f up = SampleCosineHemisphere({u[0], u[1]});
      energy *= Exp(-thickness / up.z);
      sample = scatter(-up);
    }
    sum += energy;
    sum_square += energy * energy;
  }
  const double mean = sum / kWalks;
  return {mean, std::sqrt((sum_square / kWalks - mean * mean) / kWalks)};
}

double CoatAlbedo(const Bsdf& coat, Vec3f wo) {
  constexpr uint64_t kDraws = 200000;
  double sum = 0;
  for (uint64_t i = 0; i < kDraws; ++i) {
    const auto u = CounterUniforms(23, i);
    const auto sample = SampleBsdf<kAllTraits>(coat, wo, u[0], {u[1], u[2]});
    if (sample) sum += sample->weight.g;
  }
  return sum / kDraws;
}

TEST(CoatTableTest, SmoothCoatMatchesRandomWalks) {
  for (float thickness : {0.0f, 0.01f, 0.5f}) {
    for (float rho : {0.5f, 0.9f}) {
      for (float mu : {0.9f, 0.2f}) {
        const auto interface = sheaf::testing::MakeDielectricFixture(0, 0, 1.5f, false);
        const auto coat = sheaf::testing::MakeCoatFixture(0, 0, 1.5f, thickness, Rgb::Gray(rho));
        const Vec3f wo = sheaf::testing::DirectionAt(mu, 1);
        const Estimate walk = WalkThroughCoat(interface.bsdf, wo, thickness, rho);
        EXPECT_NEAR(CoatAlbedo(coat.bsdf, wo), walk.mean, 5 * walk.error + 1e-3)
            << "thickness " << thickness << " rho " << rho << " mu " << mu;
      }
    }
  }
}

// The walk loses the interface's multiple scattering unless it is returned; the coat gives it to
// the base. Up to moderate roughness both effects are small.
TEST(CoatTableTest, RoughCoatMatchesRandomWalks) {
  for (float alpha : {0.1f, 0.3f}) {
    for (float mu : {0.9f, 0.3f}) {
      const auto interface = sheaf::testing::MakeDielectricFixture(alpha, alpha, 1.5f, true);
      const auto coat = sheaf::testing::MakeCoatFixture(alpha, alpha, 1.5f, 0.01f, Rgb::Gray(0.5f));
      const Vec3f wo = sheaf::testing::DirectionAt(mu, 1);
      const Estimate walk = WalkThroughCoat(interface.bsdf, wo, 0.01f, 0.5f);
      EXPECT_NEAR(CoatAlbedo(coat.bsdf, wo), walk.mean, 5 * walk.error + 0.01 * walk.mean)
          << "alpha " << alpha << " mu " << mu;
    }
  }
}

// Without returned energy the walk and the coat lose the same at any roughness: the closed form
// only requires a base that scatters independently of the incident direction.
TEST(CoatTableTest, LossyCoatMatchesLossyRandomWalks) {
  for (float alpha : {0.1f, 0.4f, 0.8f}) {
    for (float mu : {0.9f, 0.3f}) {
      const auto interface = sheaf::testing::MakeDielectricFixture(alpha, alpha, 1.5f, false);
      auto coat = sheaf::testing::MakeCoatFixture(alpha, alpha, 1.5f, 0.01f, Rgb::Gray(0.5f));
      const CoatRow lossy = MakeCoatRow({alpha, alpha}, 1.5f, 0.01f, false);
      coat.bsdf.coat = &lossy;
      const Vec3f wo = sheaf::testing::DirectionAt(mu, 1);
      const Estimate walk = WalkThroughCoat(interface.bsdf, wo, 0.01f, 0.5f);
      EXPECT_NEAR(CoatAlbedo(coat.bsdf, wo), walk.mean, 5 * walk.error + 0.003 * walk.mean)
          << "alpha " << alpha << " mu " << mu;
    }
  }
}

// The reason why images of rough coats by pbrt-v4 are brighter than single scattering: its
// LayeredBxDF samples the way out of the coat twice, by sampling the interface along wi and by
// sampling the base, and weights the first by p(w | wi) and the second by p(wi | w), densities in
// different measures. The weights then sum to more than 1. Their sum, weighted by the contribution
// of each way, at alpha = sqrt(0.15) and eta = 1.5:
TEST(CoatTableTest, ReferenceRendererWeightsDoNotSumToOne) {
  const float eta = 1.5f;
  const Ggx ggx{std::sqrt(0.15f), std::sqrt(0.15f)};
  // Density of refracting from wo to wi, given that the light is not reflected.
  const auto transmission_pdf = [&](float relative_eta, Vec3f wo, Vec3f wi) -> double {
    const float pdf = EvalDielectricFacet<Rgb>(ggx, relative_eta, wo, wi).pdf;
    Vec3f m = Normalize(wo + wi * relative_eta);
    if (m.z < 0) m = -m;
    const float reflectance =
        FresnelDielectric(std::fmin(Dot(wo, m), 1.0f), relative_eta).reflectance;
    return pdf > 0 ? static_cast<double>(pdf / (1 - reflectance)) : 0;
  };
  constexpr int kSteps = 400;
  const std::pair<float, double> expected[] = {{0.95f, 1.073}, {0.8f, 1.086}, {0.4f, 1.115}};
  for (const auto& [mu, weights] : expected) {
    const Vec3f wi = sheaf::testing::DirectionAt(mu, 0);
    double carried = 0, weighted = 0;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      const float cosine = std::sqrt((static_cast<float>(i / kSteps) + 0.5f) / kSteps);
      const float phi =
          2 * static_cast<float>(kPi) * (static_cast<float>(i % kSteps) + 0.5f) / kSteps;
      const Vec3f w = FlipZ(sheaf::testing::DirectionAt(cosine, phi));
      const double by_base = static_cast<double>(cosine) / kPi;
      const double by_interface = transmission_pdf(eta, wi, w);
      const double of_way_out = transmission_pdf(1 / eta, FlipZ(w), FlipZ(wi));
      const auto square = [](double x) { return x * x; };
      const double sum = square(by_interface) / (square(by_interface) + square(by_base)) +
                         square(by_base) / (square(by_base) + square(of_way_out));
      const double way =
          static_cast<double>(EvalDielectricFacet<Rgb>(ggx, eta, wi, w).f_cos.g) / by_base;
      carried += way;
      weighted += way * sum;
    }
    EXPECT_NEAR(weighted / carried, weights, 0.003) << "mu " << mu;
  }
}

TEST(CoatTableTest, SmoothCoatCurveIsFresnelTransmittance) {
  const CoatRow row = MakeCoatRow({0, 0}, 1.5f, 0);
  for (int i = 1; i < 1000; ++i) {
    const float mu = static_cast<float>(i) / 1000;
    EXPECT_NEAR(row.enter.At(FindMu(mu)), 1 - FresnelDielectric(mu, 1.5f).reflectance, 1e-3);
  }
  // Internal average of the reflectance at n = 1.5 (stability row M4).
  EXPECT_NEAR(row.recapture, 0.596345760, 1e-4);
}

TEST(EnergyTableTest, CurveAveragesAreExactForStraightLines) {
  MuCurve curve;
  for (int i = 0; i < kMuNodeCount; ++i) {
    curve.value[i] = 1 + static_cast<float>(i) / (kMuNodeCount - 1);  // 1 + sqrt(mu).
  }
  EXPECT_NEAR(curve.CosineAverage(), 1 + 0.8, 1e-6);
}

TEST(MadeTablesTest, MakesTheTableOfAKeyOnceUpToTheLimit) {
  MadeTables<int, int, 2> tables;
  int made = 0;
  const auto get = [&](int key) { return tables.Get(key, [&] { return ++made, 10 * key; }); };
  for (const int key : {1, 2, 1, 2, 3, 3}) EXPECT_EQ(get(key), 10 * key);
  EXPECT_EQ(made, 4) << "the third is not kept";
}

TEST(MadeTablesTest, RowsDifferByEachInput) {
  const CoatRow row = MakeCoatRow({0.2f, 0.2f}, 1.5f, 0.01f, true);
  const auto differs = [&](const CoatRow& other) {
    return other.enter.value != row.enter.value || other.recapture != row.recapture;
  };
  EXPECT_FALSE(differs(MakeCoatRow({0.2f, 0.2f}, 1.5f, 0.01f, true)));
  EXPECT_TRUE(differs(MakeCoatRow({0.3f, 0.2f}, 1.5f, 0.01f, true)));
  EXPECT_TRUE(differs(MakeCoatRow({0.2f, 0.3f}, 1.5f, 0.01f, true)));
  EXPECT_TRUE(differs(MakeCoatRow({0.2f, 0.2f}, 1.4f, 0.01f, true)));
  EXPECT_TRUE(differs(MakeCoatRow({0.2f, 0.2f}, 1.5f, 0.02f, true)));
  EXPECT_TRUE(differs(MakeCoatRow({0.2f, 0.2f}, 1.5f, 0.01f, false)));
}

}  // namespace
}  // namespace sheaf::render
