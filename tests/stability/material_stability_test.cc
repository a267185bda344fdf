// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of materials, named as in the catalogue: M1 to M13. Expected values are closed forms
// or high-precision quadrature.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

#include "gtest/gtest.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_materials.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::CounterUniforms;
using sheaf::testing::DirectionAt;
using sheaf::testing::MakeCoatFixture;
using sheaf::testing::MakeConductorCoatFixture;
using sheaf::testing::MakeConductorFixture;
using sheaf::testing::MakeDielectricFixture;
using sheaf::testing::MakeDiffuseFixture;
using sheaf::testing::MakeMirrorFixture;
using sheaf::testing::MakeSheetFixture;

// Mean energy scattered along wo by stratified sampling. Transmitted light is counted as energy,
// not as radiance. Two of the random numbers are stratified to side x side cells.
double Albedo(const Bsdf& bsdf, Vec3f wo, int side = 384) {
  double sum = 0;
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      const auto jitter = CounterUniforms(11, static_cast<uint64_t>(i) * side + j);
      const Vec2f u{(static_cast<float>(i) + jitter[1]) / static_cast<float>(side),
                    (static_cast<float>(j) + jitter[2]) / static_cast<float>(side)};
      const auto sample = SampleBsdf<kAllTraits>(bsdf, wo, jitter[0], u);
      if (sample) sum += sample->weight.g * sample->eta_scale;
    }
  }
  return sum / (static_cast<double>(side) * side);
}

// Cosine-weighted average over a hemisphere of f(mu), by steps over mu^2.
template <typename F>
double CosineAverage(F f, int steps = 100000) {
  double sum = 0;
  for (int i = 0; i < steps; ++i) sum += f(static_cast<float>(std::sqrt((i + 0.5) / steps)));
  return sum / steps;
}

TEST(MaterialStability, M1_HighlightsOfVanishingRoughnessKeepTheirIntegral) {
  for (float alpha : {1e-1f, 1e-2f, 1e-3f, 1e-4f, 1e-5f, 1e-6f}) {
    const BsdfFixture fixture = MakeMirrorFixture(alpha, alpha, true);
    for (float mu : {1.0f, 0.5f}) {
      EXPECT_NEAR(Albedo(fixture.bsdf, DirectionAt(mu, 1)), 1, 1e-3) << "alpha " << alpha;
    }
  }
}

TEST(MaterialStability, M1_DistributionIsExactAtItsKnee) {
  for (float alpha : {1e-1f, 1e-2f, 1e-3f, 1e-4f, 1e-6f}) {
    const double sin_theta = alpha / std::sqrt(1 + static_cast<double>(alpha) * alpha);
    const double cos2 = 1 / (1 + static_cast<double>(alpha) * alpha);
    const Vec3f m = ToFloat({sin_theta, 0, std::sqrt(cos2)});
    // tan theta = alpha: D = 1 / (4 pi alpha^2 cos^4).
    const double expected = 1 / (4 * kPi * static_cast<double>(alpha) * alpha * cos2 * cos2);
    const Ggx ggx{alpha, alpha};
    EXPECT_NEAR(ggx.D(m) / expected, 1, 1e-6) << alpha;
    if (alpha > 2e-3f || alpha < 5e-5f) continue;
    ExpectHardCase({.row = "M1",
                    .figure = alpha > 5e-4f ? "D over its value at tan theta = alpha = 1e-3"
                                            : "D over its value at tan theta = alpha = 1e-4",
                    .expected = 1,
                    .measured = ggx.D(m) / expected,
                    .tolerance = 1e-6,
                    .naive = naive::GgxD(alpha, m.z) / static_cast<float>(expected),
                    .naive_by = "D from the cosine alone"});
  }
}

TEST(MaterialStability, M2_SingleScatteringAlbedoHasItsKnownValues) {
  struct Case {
    float alpha, mu;
    double albedo;
  };
  const Case cases[] = {{1, 1, 1 - 0.69314718056}, {1, 0.5f, 0.4507},    {1, 0.1f, 0.7602},
                        {0.5f, 1, 0.6879},         {0.5f, 0.5f, 0.6983}, {0.5f, 0.1f, 0.8601},
                        {0.3f, 1, 0.8774},         {0.3f, 0.5f, 0.8217}, {0.3f, 0.1f, 0.8888},
                        {0.1f, 1, 0.9883},         {0.1f, 0.5f, 0.9692}, {0.1f, 0.1f, 0.8835}};
  for (const Case& c : cases) {
    EXPECT_NEAR(IntegrateMirror({c.alpha, c.alpha}, c.mu), c.albedo, 3e-4)
        << "alpha " << c.alpha << " mu " << c.mu;
    EXPECT_NEAR(Albedo(MakeMirrorFixture(c.alpha, c.alpha, false).bsdf, DirectionAt(c.mu, 1)),
                c.albedo, 2e-3);
  }
  const double averages[][2] = {{1, 0.40888}, {0.5, 0.7001}, {0.3, 0.8467}, {0.1, 0.9719}};
  for (const auto& [alpha, average] : averages) {
    const ConductorEnergyRow row =
        MakeConductorEnergyRow({static_cast<float>(alpha), static_cast<float>(alpha)});
    EXPECT_NEAR(1 - static_cast<double>(row.lobe.average_loss), average, 5e-4) << alpha;
  }
}

TEST(MaterialStability, M2_RoughMirrorsReflectEverything) {
  for (float alpha : {0.01f, 0.05f, 0.1f, 0.3f, 0.5f, 1.0f}) {
    const BsdfFixture fixture = MakeMirrorFixture(alpha, alpha, true);
    for (float mu : {1.0f, 0.7f, 0.3f, 0.1f, 0.01f}) {
      EXPECT_NEAR(Albedo(fixture.bsdf, DirectionAt(mu, 1)), 1, 0.005)
          << "alpha " << alpha << " mu " << mu;
    }
  }
  ExpectHardCase({.row = "M2",
                  .figure = "albedo of a mirror of roughness 1, seen along its normal",
                  .expected = 1,
                  .measured = Albedo(MakeMirrorFixture(1, 1, true).bsdf, DirectionAt(1, 1)),
                  .tolerance = 0.005,
                  .naive = naive::SingleScattering(1, {0, 0, 1}),
                  .naive_by = "single scattering"});
}

TEST(MaterialStability, M2_AnisotropicMirrorsReflectEverythingOnAverageOverAzimuths) {
  for (const auto& [alpha_x, alpha_y] : {std::array<float, 2>{0.1f, 0.5f}, {0.3f, 1.0f}}) {
    const BsdfFixture fixture = MakeMirrorFixture(alpha_x, alpha_y, true);
    for (float mu : {1.0f, 0.5f, 0.1f}) {
      double mean = 0;
      constexpr int kAzimuths = 7;
      for (int i = 0; i < kAzimuths; ++i) {
        const float phi = static_cast<float>(kPi / 2) * (static_cast<float>(i) + 0.5f) / kAzimuths;
        mean += Albedo(fixture.bsdf, DirectionAt(mu, phi), 192) / kAzimuths;
      }
      EXPECT_NEAR(mean, 1, 0.005) << alpha_x << " " << alpha_y << " mu " << mu;
    }
  }
}

TEST(MaterialStability, M2_RoughGlassKeepsEnergyOnBothSides) {
  for (float eta : {1.33f, 1.5f, 2.42f}) {
    for (float alpha : {0.1f, 0.5f, 1.0f}) {
      const BsdfFixture fixture = MakeDielectricFixture(alpha, alpha, eta, true);
      for (float mu : {0.9f, 0.3f, 0.05f, -0.9f, -0.3f, -0.05f}) {
        EXPECT_NEAR(Albedo(fixture.bsdf, DirectionAt(mu, 1)), 1, 0.005)
            << "eta " << eta << " alpha " << alpha << " mu " << mu;
      }
    }
  }
}

TEST(MaterialStability, M2_BlendedRowsKeepEnergyBetweenTheAlphasOfTheTable) {
  for (float alpha : {0.02f, 0.13f, 0.41f, 0.87f}) {
    const RowBlend at = FindAlphaRow(alpha);
    const float low = AlphaNode(at.index), high = AlphaNode(at.index + 1);
    const std::array<ConductorEnergyRow, 2> rows = {MakeConductorEnergyRow({low, low}),
                                                    MakeConductorEnergyRow({high, high})};
    BsdfFixture fixture = MakeMirrorFixture(alpha, alpha, false);
    fixture.bsdf.color = Rgb::Gray(1);
    fixture.bsdf.conductor_energy = rows.data();
    fixture.bsdf.blend = at.fraction;
    for (float mu : {1.0f, 0.3f, 0.05f}) {
      EXPECT_NEAR(Albedo(fixture.bsdf, DirectionAt(mu, 1)), 1, 0.005) << alpha << " " << mu;
    }
  }
}

TEST(MaterialStability, M2_WhiteCoatsLoseNothing) {
  for (float alpha : {0.0f, 0.1f, 0.3f, 1.0f}) {
    for (float eta : {1.2f, 1.5f, 2.0f}) {
      const BsdfFixture fixture = MakeCoatFixture(alpha, alpha, eta, 0, Rgb::Gray(1));
      for (float mu : {1.0f, 0.5f, 0.1f, 0.01f}) {
        EXPECT_NEAR(Albedo(fixture.bsdf, DirectionAt(mu, 1)), 1, 0.005)
            << "alpha " << alpha << " eta " << eta << " mu " << mu;
      }
    }
  }
}

TEST(MaterialStability, M2_CoatsOfPerfectMetalLoseNothing) {
  constexpr int kSide = 576;  // Three random choices: noisier than others.
  for (float interface : {0.0f, 0.1f, 1.0f}) {
    for (float base : {0.0f, 0.1f, 0.6f}) {
      for (float eta : {1.5f, 2.0f}) {
        const BsdfFixture fixture =
            MakeConductorCoatFixture({interface, interface}, {base, base}, eta, 0, 1);
        for (float mu : {1.0f, 0.5f, 0.1f, 0.01f}) {
          EXPECT_NEAR(Albedo(fixture.bsdf, DirectionAt(mu, 1), kSide), 1, 0.005)
              << fixture.name << " eta " << eta << " mu " << mu;
        }
      }
    }
  }
}

TEST(MaterialStability, M2_SheetsTransmitUnreflectedLight) {
  for (float reflectance : {0.0f, 0.3f, 1.0f}) {
    const BsdfFixture sheet = MakeSheetFixture(Rgb::Gray(reflectance), Rgb::Gray(1 - reflectance));
    for (float mu : {1.0f, 0.01f, -0.5f}) {
      EXPECT_NEAR(Albedo(sheet.bsdf, DirectionAt(mu, 1)), 1, 1e-5) << reflectance << " " << mu;
    }
  }
}

TEST(MaterialStability, M3_GrazingDirectionsGiveFiniteWeights) {
  for (float alpha : {0.01f, 0.3f, 1.0f}) {
    for (const BsdfFixture& fixture :
         {MakeMirrorFixture(alpha, alpha, true), MakeDielectricFixture(alpha, alpha, 1.5f, true),
          MakeCoatFixture(alpha, alpha, 1.5f, 0.01f, Rgb::Gray(1)),
          MakeConductorCoatFixture({alpha, alpha}, {0, 0}, 1.5f, 0.01f, 1),
          MakeConductorCoatFixture({0, 0}, {alpha, alpha}, 1 / 1.5f, 0.01f, 1)}) {
      for (float mu : {1e-1f, 1e-3f, 1e-5f, 1e-7f, 1e-20f, -1e-7f}) {
        for (uint64_t i = 0; i < 2000; ++i) {
          const auto u = CounterUniforms(2, i);
          const auto sample =
              SampleBsdf<kAllTraits>(fixture.bsdf, DirectionAt(mu, 1), u[0], {u[1], u[2]});
          if (!sample) continue;
          ASSERT_TRUE(IsFinite(sample->weight) && std::isfinite(sample->pdf)) << fixture.name;
          ASSERT_NEAR(Length(sample->wi), 1, 1e-4) << fixture.name;
        }
      }
    }
  }
  const BsdfFixture single = MakeMirrorFixture(0.3f, 0.3f, false);
  const Vec3f wo = DirectionAt(1e-3f, 0);
  float excess = 0, naive_excess = 0;
  for (uint64_t i = 0; i < 20000; ++i) {
    const auto u = CounterUniforms(2, i);
    const auto sample = SampleBsdf<kAllTraits>(single.bsdf, wo, u[0], {u[1], u[2]});
    if (sample) excess = std::max(excess, sample->weight.g - 1);
    naive_excess = std::max(naive_excess, naive::WeightByDistribution(0.3f, wo, u[1], u[2]) - 1);
  }
  ExpectHardCase({.row = "M3",
                  .figure = "most by which a weight exceeds 1, at a cosine of 1e-3",
                  .expected = 0,
                  .measured = excess,
                  .tolerance = 1e-5,
                  .naive = naive_excess,
                  .naive_by = "normals drawn from D cos"});
}

TEST(MaterialStability, M4_TotalReflectionSetsInAtTheCriticalAngle) {
  const double angles[][2] = {{1.5, 41.8103149}, {1.33, 48.7534667}, {2.42, 24.4074689}};
  for (const auto& [n, degrees] : angles) {
    const auto reflectance = [eta = 1 / n](double angle_degrees) {
      return FresnelDielectric(static_cast<float>(Cos(angle_degrees * kPi / 180)),
                               static_cast<float>(eta))
          .reflectance;
    };
    ExpectHardCase(
        {.row = "M4",
         .figure = "reflectance beyond the critical angle of n = " + InWords(n),
         .expected = 1,
         .measured = reflectance(degrees + 1e-3),
         .naive = naive::FresnelDielectric(static_cast<float>(Cos((degrees + 1e-3) * kPi / 180)),
                                           static_cast<float>(1 / n)),
         .naive_by = "cosine within as the root of 1 - sin^2"});
    EXPECT_LT(reflectance(degrees - 1e-3), 1) << n;
    EXPECT_GT(reflectance(degrees - 1e-3), 0.9) << n;  // The root rises steeply, without a jump.
    EXPECT_GT(reflectance(degrees - 1e-6 * 180 / kPi), 0.98) << n;
  }
}

TEST(MaterialStability, M4_FresnelAveragesOverTheHemisphere) {
  const double rows[][3] = {{1.33, 0.065930849, 0.471949149},
                            {1.5, 0.091777959, 0.596345760},
                            {2.42, 0.212540790, 0.865538694}};
  for (const auto& [n, outside, inside] : rows) {
    const auto eta = static_cast<float>(n);
    const double f_e =
        CosineAverage([&](float mu) { return FresnelDielectric(mu, eta).reflectance; });
    const double f_i =
        CosineAverage([&](float mu) { return FresnelDielectric(mu, 1 / eta).reflectance; });
    EXPECT_NEAR(f_e, outside, 2e-6) << n;
    EXPECT_NEAR(f_i, inside, 2e-6) << n;
    EXPECT_NEAR(f_i, 1 - (1 - f_e) / (n * n), 2e-6) << n;
  }
}

TEST(MaterialStability, M5_IndexOneTransmitsEverythingStraight) {
  const BsdfFixture fixture = MakeDielectricFixture(0, 0, 1, false);
  for (float mu : {1.0f, 0.37f, 1e-3f, -0.2f}) {
    const Vec3f wo = DirectionAt(mu, 2);
    const auto sample = SampleBsdf<kAllTraits>(fixture.bsdf, wo, 0, {0.5f, 0.5f});
    ASSERT_TRUE(sample.has_value());
    EXPECT_EQ(sample->wi, -wo);
    EXPECT_EQ(sample->weight, Rgb::Gray(1));
    ExpectHardCase({.row = "M5",
                    .figure = "weight of light through glass of index 1",
                    .expected = 1,
                    .measured = sample->weight.g,
                    .naive = naive::TransmissionCosine(wo, sample->wi, 1),
                    .naive_by = "cosine with the half vector wo + eta wi, as a factor"});
    EXPECT_EQ(sample->eta_scale, 1);
    EXPECT_TRUE((sample->flags & kBsdfTransmission) != 0);
  }
}

TEST(MaterialStability, M6_RoughDielectricsAreReciprocal) {
  double asymmetry = 0, naive_asymmetry = 0;
  for (float alpha : {0.1f, 0.5f, 1.0f}) {
    for (float eta : {1.33f, 1.5f, 1 / 1.5f}) {
      const BsdfFixture keep = MakeDielectricFixture(alpha, alpha, eta, true);
      for (uint64_t i = 0; i < 500; ++i) {
        const auto u = CounterUniforms(9, i), v = CounterUniforms(10, i);
        const Vec3f a = DirectionAt(2 * u[0] - 1, 6.2f * u[1]);
        const Vec3f b = DirectionAt(2 * v[0] - 1, 6.2f * v[1]);
        if (a.z == 0 || b.z == 0) continue;
        // f(a, b) is the fraction of radiance from b that leaves along a.
        const double ab = EvalBsdf<kAllTraits>(keep.bsdf, a, b).f_cos.g / std::fabs(b.z);
        const double ba = EvalBsdf<kAllTraits>(keep.bsdf, b, a).f_cos.g / std::fabs(a.z);
        const double eta_a = a.z > 0 ? 1 : eta, eta_b = b.z > 0 ? 1 : eta;
        EXPECT_NEAR(ab * eta_b * eta_b, ba * eta_a * eta_a, 2e-4 * ab * eta_b * eta_b + 1e-6)
            << a.z << " " << b.z;
        const auto off = [](double x, double y) { return std::fabs(x - y) / (x + 5e-3); };
        asymmetry = std::max(asymmetry, off(ab * eta_b * eta_b, ba * eta_a * eta_a));
        naive_asymmetry = std::max(naive_asymmetry, off(ab, ba));
      }
    }
  }
  ExpectHardCase({.row = "M6",
                  .figure = "largest relative difference between rough glass and its reverse",
                  .expected = 0,
                  .measured = asymmetry,
                  .tolerance = 2e-4,
                  .naive = naive_asymmetry,
                  .naive_by = "without the squares of the indices"});
}

TEST(MaterialStability, M6_ConductorsAndCoatsAreReciprocal) {
  const BsdfFixture fixtures[] = {
      MakeConductorFixture(0.5f, 0.5f, {0.2f, 0.4f, 1.4f}, {3.9f, 2.4f, 1.6f}, true),
      MakeConductorFixture(0.1f, 0.7f, {0.2f, 0.4f, 1.4f}, {3.9f, 2.4f, 1.6f}, true),
      MakeCoatFixture(0.3f, 0.3f, 1.5f, 0.1f, {0.2f, 0.5f, 0.9f}),
      MakeCoatFixture(0, 0, 1.5f, 0.1f, {0.2f, 0.5f, 0.9f}),
      MakeConductorCoatFixture({0.3f, 0.3f}, {0.2f, 0.2f}, 1.5f, 0.1f, 0.9f),
      MakeConductorCoatFixture({0, 0}, {0.1f, 0.5f}, 1.5f, 0, 0.9f),
      MakeConductorCoatFixture({0.3f, 0.3f}, {0, 0}, 1.5f, 0.1f, 1)};
  for (const BsdfFixture& fixture : fixtures) {
    for (uint64_t i = 0; i < 500; ++i) {
      const auto u = CounterUniforms(9, i), v = CounterUniforms(10, i);
      const Vec3f a = DirectionAt(0.01f + 0.99f * u[0], 6.2f * u[1]);
      const Vec3f b = DirectionAt(0.01f + 0.99f * v[0], 6.2f * v[1]);
      const float ab = EvalBsdf<kAllTraits>(fixture.bsdf, a, b).f_cos.g / b.z;
      const float ba = EvalBsdf<kAllTraits>(fixture.bsdf, b, a).f_cos.g / a.z;
      EXPECT_NEAR(ab, ba, 1e-4f * ab) << fixture.name;
    }
  }
}

TEST(MaterialStability, M6_SheetsAreReciprocal) {
  const BsdfFixture sheet = MakeSheetFixture({0.2f, 0.5f, 0.1f}, {0.7f, 0.1f, 0});
  for (uint64_t i = 0; i < 200; ++i) {
    const auto u = CounterUniforms(9, i), v = CounterUniforms(10, i);
    const Vec3f a = DirectionAt(2 * u[0] - 1, 6.2f * u[1]);
    const Vec3f b = DirectionAt(2 * v[0] - 1, 6.2f * v[1]);
    if (a.z == 0 || b.z == 0) continue;
    const float ab = EvalBsdf<kAllTraits>(sheet.bsdf, a, b).f_cos.r / std::fabs(b.z);
    const float ba = EvalBsdf<kAllTraits>(sheet.bsdf, b, a).f_cos.r / std::fabs(a.z);
    EXPECT_NEAR(ab, ba, 1e-5f) << a.z << " " << b.z;
    EXPECT_NEAR(ab, (a.z * b.z > 0 ? 0.2f : 0.7f) / static_cast<float>(kPi), 1e-5f);
  }
}

TEST(MaterialStability, M7_PerfectReflectanceNeitherLosesNorGains) {
  ExpectHardCase({.row = "M7",
                  .figure = "Fresnel reflectance of a perfect conductor",
                  .expected = 1,
                  .measured = FresnelConductor(0.3f, 1, kPerfectConductorK),
                  .naive = naive::ConductorOfReflectance(1),
                  .naive_by = "k = 2 sqrt(r) / sqrt(1 - r)"});
  // k = 0 is a dielectric: the same reflectance as Fresnel's real form, total reflection included.
  for (float mu : {1.0f, 0.6f, 0.1f, 1e-3f, 0.0f}) {
    for (float eta : {1.5f, 1 / 1.5f}) {
      EXPECT_NEAR(FresnelConductor(mu, eta, 0), FresnelDielectric(mu, eta).reflectance, 3e-4)
          << mu << " " << eta;
    }
  }
  // Ten thousand bounces between white walls and mirrors.
  const BsdfFixture white = MakeDiffuseFixture(Rgb::Gray(1)),
                    mirror = MakeMirrorFixture(0, 0, false);
  double throughput = 1;
  for (uint64_t i = 0; i < 10000; ++i) {
    const auto u = CounterUniforms(1, i);
    const Bsdf& bsdf = i % 2 == 0 ? white.bsdf : mirror.bsdf;
    const auto sample = SampleBsdf<kAllTraits>(bsdf, DirectionAt(0.5f, 1), u[0], {u[1], u[2]});
    ASSERT_TRUE(sample.has_value());
    throughput *= sample->weight.g;
  }
  EXPECT_NEAR(throughput, 1, 1e-6);
}

TEST(MaterialStability, M8_SlabsTransmitTheirClosedForm) {
  for (const auto& [n, transmitted] :
       {std::array<double, 2>{1.5, 0.923076923}, {1.33, 0.960670302}}) {
    Bsdf bsdf;
    bsdf.kind = BsdfKind::kThinDielectric;
    bsdf.specular = true;
    bsdf.eta = static_cast<float>(n);
    constexpr int kDraws = 100000;
    int crossed = 0;
    for (int i = 0; i < kDraws; ++i) {
      const float u_lobe = (static_cast<float>(i) + 0.5f) / kDraws;
      const auto sample = SampleBsdf<kAllTraits>(bsdf, {0, 0, 1}, u_lobe, {0.5f, 0.5f});
      ASSERT_TRUE(sample.has_value());
      EXPECT_EQ(sample->weight, Rgb::Gray(1));
      if ((sample->flags & kBsdfTransmission) != 0) ++crossed;
    }
    ExpectHardCase({.row = "M8",
                    .figure = "part of light through a slab of n = " + InWords(n),
                    .expected = transmitted,
                    .measured = static_cast<double>(crossed) / kDraws,
                    .tolerance = 2.0 / kDraws,
                    .naive = naive::SlabInOnePass(static_cast<float>(n)),
                    .naive_by = "(1 - R)^2, without the light between the faces"});
  }
  // A single pass through glass, water, glass: four interfaces, no inner reflections.
  const auto pass = [](double eta) {
    return 1.0 - static_cast<double>(FresnelDielectric(1, static_cast<float>(eta)).reflectance);
  };
  EXPECT_NEAR(pass(1.5) * pass(1.33 / 1.5) * pass(1.5 / 1.33) * pass(1 / 1.5), 0.914960840, 1e-6);
}

TEST(MaterialStability, M9_PrismsDeflectByTheirMinimumDeviation) {
  for (const auto& [n, degrees] :
       {std::array<double, 2>{1.5, 37.18075578}, {1.51432, 38.42893}, {1.52238, 39.13844}}) {
    // Symmetric path through a prism of 60 degrees: 30 degrees inside at both faces.
    const auto eta = static_cast<float>(n);
    const double incidence = Asin(0.5 * n);
    const Vec3f wo = DirectionAt(static_cast<float>(Cos(incidence)), 0);
    const auto in = SampleBsdf<kAllTraits>(MakeDielectricFixture(0, 0, eta, false).bsdf, wo, 0.999f,
                                           {0.5f, 0.5f});
    ASSERT_TRUE(in.has_value());
    ASSERT_TRUE((in->flags & kBsdfTransmission) != 0);
    const double bend =
        incidence - Atan2(std::fabs(static_cast<double>(in->wi.x)), -static_cast<double>(in->wi.z));
    ExpectHardCase({.row = "M9",
                    .figure = "degrees by which a prism bends at n = " + InWords(n),
                    .expected = degrees,
                    .measured = 2 * bend * 180 / kPi,
                    .tolerance = 2e-5,
                    .naive = naive::PrismDeviation(eta),
                    .naive_by = "arccos of a float cosine"});
  }
}

}  // namespace
}  // namespace sheaf::render
