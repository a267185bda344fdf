// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests every Bsdf's sampler against its pdf, for normal to grazing directions and from both sides;
// and the identities between weight, value and pdf.
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::ChiSquareGrid;
using sheaf::testing::ChiSquareResult;
using sheaf::testing::CounterUniforms;
using sheaf::testing::DirectionAt;
using sheaf::testing::MakeCoatFixture;
using sheaf::testing::MakeConductorCoatFixture;
using sheaf::testing::MakeConductorFixture;
using sheaf::testing::MakeDielectricFixture;
using sheaf::testing::MakeDiffuseFixture;
using sheaf::testing::MakeMirrorFixture;
using sheaf::testing::MakeSheetFixture;

constexpr uint64_t kSampleCount = 1000000;
constexpr double kSignificance = 0.01;  // For the whole file.
constexpr int kTestCount = 96;          // At least the number of chi-square tests in this file.

const Rgb kGoldEta{0.143f, 0.375f, 1.442f}, kGoldK{3.983f, 2.386f, 1.603f};

// Fails the test if sampler and pdf disagree.
void ExpectSamplerMatchesPdf(const BsdfFixture& fixture, Vec3f wo) {
  const Bsdf& bsdf = fixture.bsdf;
  const auto sample = [&](std::array<float, 3> u) -> std::optional<Vec3f> {
    const auto s = SampleBsdf<kAllTraits>(bsdf, wo, u[0], {u[1], u[2]});
    if (!s || (s->flags & kBsdfSpecular) != 0) return std::nullopt;
    return s->wi;
  };
  const auto pdf = [&](Vec3f wi) -> double { return EvalBsdf<kAllTraits>(bsdf, wo, wi).pdf; };
  ChiSquareGrid grid;
  if (!Transmits<kAllTraits>(bsdf)) {
    grid.cos_min = wo.z > 0 ? 0 : -1;
    grid.cos_max = wo.z > 0 ? 1 : 0;
  }
  const ChiSquareResult result = sheaf::testing::ChiSquareTest(sample, pdf, grid, kSampleCount);
  EXPECT_GE(result.p_value, sheaf::testing::SidakThreshold(kSignificance, kTestCount))
      << fixture.name << ", wo.z " << wo.z << ": " << result.text;
  // Error of the quadrature at edges of the density.
  EXPECT_LE(result.pdf_integral, 1 + 1e-3)
      << fixture.name << ", wo.z " << wo.z << ": " << result.text;
}

TEST(BsdfChiSquareTest, Diffuse) {
  const BsdfFixture fixture = MakeDiffuseFixture({0.5f, 0.6f, 0.7f});
  ExpectSamplerMatchesPdf(fixture, DirectionAt(0.7f, 1));
  ExpectSamplerMatchesPdf(fixture, DirectionAt(-0.7f, 1));
}

TEST(BsdfChiSquareTest, DiffuseTransmission) {
  const BsdfFixture leaf = MakeSheetFixture({0.1f, 0.3f, 0.05f}, {0.2f, 0.5f, 0.1f});
  ExpectSamplerMatchesPdf(leaf, DirectionAt(0.7f, 1));
  ExpectSamplerMatchesPdf(leaf, DirectionAt(-0.01f, 1));
  ExpectSamplerMatchesPdf(MakeSheetFixture({}, Rgb::Gray(0.5f)), DirectionAt(0.4f, 1));
}

TEST(BsdfChiSquareTest, RoughConductors) {
  for (float alpha : {0.05f, 0.3f, 1.0f}) {
    for (bool keeps_energy : {false, true}) {
      const BsdfFixture fixture =
          MakeConductorFixture(alpha, alpha, kGoldEta, kGoldK, keeps_energy);
      ExpectSamplerMatchesPdf(fixture, DirectionAt(1, 0));
      ExpectSamplerMatchesPdf(fixture, DirectionAt(0.6f, 2));
    }
  }
  ExpectSamplerMatchesPdf(MakeConductorFixture(0.4f, 0.4f, kGoldEta, kGoldK, true),
                          DirectionAt(-0.5f, 4));
}

TEST(BsdfChiSquareTest, RoughConductorsAtGrazingAngles) {
  const BsdfFixture fixture = MakeMirrorFixture(0.3f, 0.3f, true);
  for (float mu : {1e-1f, 1e-2f, 1e-3f, 1e-4f})
    ExpectSamplerMatchesPdf(fixture, DirectionAt(mu, 3));
}

TEST(BsdfChiSquareTest, AnisotropicConductors) {
  const BsdfFixture fixture = MakeConductorFixture(0.1f, 0.6f, kGoldEta, kGoldK, true);
  ExpectSamplerMatchesPdf(fixture, DirectionAt(0.8f, 0.5f));
  ExpectSamplerMatchesPdf(fixture, DirectionAt(0.05f, 1.2f));
}

TEST(BsdfChiSquareTest, RoughDielectricsFromBothSides) {
  for (float eta : {1.5f, 1 / 1.5f}) {
    for (float alpha : {0.1f, 1.0f}) {
      const BsdfFixture fixture = MakeDielectricFixture(alpha, alpha, eta, true);
      for (float mu : {0.9f, 0.3f, -0.9f, -0.3f}) {
        ExpectSamplerMatchesPdf(fixture, DirectionAt(mu, 2.5f));
      }
    }
  }
}

TEST(BsdfChiSquareTest, RoughDielectricsAtGrazingAngles) {
  const BsdfFixture fixture = MakeDielectricFixture(0.3f, 0.3f, 1.5f, true);
  for (float mu : {1e-1f, 1e-3f, -1e-1f, -1e-3f}) {
    ExpectSamplerMatchesPdf(fixture, DirectionAt(mu, 1));
  }
  ExpectSamplerMatchesPdf(MakeDielectricFixture(0.1f, 0.5f, 1.5f, true), DirectionAt(0.6f, 1));
}

TEST(BsdfChiSquareTest, RoughCoats) {
  for (float alpha : {0.1f, 0.5f}) {
    const BsdfFixture fixture = MakeCoatFixture(alpha, alpha, 1.5f, 0.01f, {0.8f, 0.5f, 0.3f});
    for (float mu : {0.9f, 0.2f, 1e-3f, -0.5f}) {
      ExpectSamplerMatchesPdf(fixture, DirectionAt(mu, 1.7f));
    }
  }
}

// The smooth coat's diffuse lobe has only part of the probability mass: the rest is the mirror
// direction.
TEST(BsdfChiSquareTest, SmoothCoatsChooseLobesByTheirProbabilities) {
  const BsdfFixture fixture = MakeCoatFixture(0, 0, 1.5f, 0.01f, {0.8f, 0.5f, 0.3f});
  ExpectSamplerMatchesPdf(fixture, DirectionAt(0.9f, 1));
  ExpectSamplerMatchesPdf(fixture, DirectionAt(0.1f, 1));
}

TEST(BsdfChiSquareTest, CoatedConductors) {
  const BsdfFixture fixtures[] = {
      MakeConductorCoatFixture({0.2f, 0.2f}, {0.3f, 0.3f}, 1.5f, 0.01f, 0.8f),
      MakeConductorCoatFixture({0.1f, 0.4f}, {0.3f, 0.1f}, 1.5f, 0.01f, 0.8f),
      MakeConductorCoatFixture({0, 0}, {0.5f, 0.5f}, 1.8f, 0.1f, 1),
      MakeConductorCoatFixture({0.3f, 0.3f}, {0, 0}, 1.5f, 0, 0.9f)};
  for (const BsdfFixture& fixture : fixtures) {
    for (float mu : {0.9f, 0.3f, -0.5f}) ExpectSamplerMatchesPdf(fixture, DirectionAt(mu, 1.7f));
  }
  ExpectSamplerMatchesPdf(fixtures[0], DirectionAt(1e-3f, 1.7f));
}

std::vector<BsdfFixture> RoughFixtures() {
  std::vector<BsdfFixture> fixtures = {MakeDiffuseFixture({0.2f, 0.5f, 0.9f}),
                                       MakeSheetFixture({0.2f, 0.5f, 0.1f}, {0.7f, 0.1f, 0}),
                                       MakeCoatFixture(0.2f, 0.2f, 1.5f, 0.01f, {0.2f, 0.5f, 0.9f}),
                                       MakeConductorFixture(0.05f, 0.3f, kGoldEta, kGoldK, true),
                                       MakeMirrorFixture(0.01f, 0.01f, true)};
  for (float alpha : {0.01f, 0.3f, 1.0f}) {
    fixtures.push_back(MakeConductorFixture(alpha, alpha, kGoldEta, kGoldK, true));
    fixtures.push_back(MakeConductorCoatFixture({alpha, alpha}, {0.2f, 0.2f}, 1.5f, 0.01f, 0.9f));
    fixtures.push_back(MakeDielectricFixture(alpha, alpha, 1.5f, true));
    fixtures.push_back(MakeDielectricFixture(alpha, alpha, 1.5f, false));
  }
  return fixtures;
}

// Stability row M13.
TEST(BsdfSampleTest, SamplePdfEqualsEvaluatedPdf) {
  for (const BsdfFixture& fixture : RoughFixtures()) {
    for (float mu : {1.0f, 0.5f, 0.01f, -0.5f}) {
      const Vec3f wo = DirectionAt(mu, 1);
      for (uint64_t i = 0; i < 2000; ++i) {
        const auto u = CounterUniforms(7, i);
        const auto sample = SampleBsdf<kAllTraits>(fixture.bsdf, wo, u[0], {u[1], u[2]});
        if (!sample || (sample->flags & kBsdfSpecular) != 0) continue;
        const BsdfValue value = EvalBsdf<kAllTraits>(fixture.bsdf, wo, sample->wi);
        ASSERT_EQ(sample->pdf, value.pdf) << fixture.name;
        ASSERT_EQ(PdfBsdf<kAllTraits>(fixture.bsdf, wo, sample->wi), value.pdf) << fixture.name;
        ASSERT_NEAR(sample->weight.g * sample->pdf, value.f_cos.g, 1e-5 * value.f_cos.g);
        ASSERT_TRUE(IsFinite(sample->weight) && sample->weight.r >= 0) << fixture.name;
      }
    }
  }
}

// Stability row M13: the mean weight is the albedo, computed here by a different estimator:
// quadrature of uniform directions over the sphere.
TEST(BsdfSampleTest, MeanWeightEqualsTheIntegral) {
  for (const BsdfFixture& fixture : RoughFixtures()) {
    const BsdfKind kind = fixture.bsdf.kind;
    const bool is_diffuse = kind == BsdfKind::kDiffuse || kind == BsdfKind::kDiffuseTransmission;
    if (!is_diffuse && fixture.bsdf.alpha_x < 0.1f) continue;
    for (float mu : {0.8f, -0.4f}) {
      const Vec3f wo = DirectionAt(mu, 1);
      double integral = 0, mean = 0;
      constexpr int kSteps = 400;
      for (int i = 0; i < 2 * kSteps; ++i) {
        for (int j = 0; j < kSteps; ++j) {
          const float z = (static_cast<float>(i) + 0.5f) / kSteps - 1;
          const Vec3f wi =
              DirectionAt(z, 2 * static_cast<float>(kPi) * (static_cast<float>(j) + 0.5f) / kSteps);
          integral += EvalBsdf<kAllTraits>(fixture.bsdf, wo, wi).f_cos.g;
        }
      }
      integral *= 2 * kPi / (kSteps * kSteps);
      constexpr uint64_t kDraws = 200000;
      double mean_square = 0;
      for (uint64_t i = 0; i < kDraws; ++i) {
        const auto u = CounterUniforms(3, i);
        const auto sample = SampleBsdf<kAllTraits>(fixture.bsdf, wo, u[0], {u[1], u[2]});
        const double weight = sample ? sample->weight.g : 0;
        mean += weight / kDraws;
        mean_square += weight * weight / kDraws;
      }
      const double error = std::sqrt(std::max(0.0, mean_square - mean * mean) / kDraws);
      EXPECT_NEAR(mean, integral, 4.5 * error + 1e-3) << fixture.name << " mu " << mu;
    }
  }
}

// Stability row M3: with visible normals the weight of single scattering is G2 / G1, never more
// than 1.
TEST(BsdfSampleTest, SingleScatteringWeightsAreAtMostOne) {
  for (float alpha : {0.01f, 0.3f, 1.0f}) {
    const BsdfFixture fixture = MakeMirrorFixture(alpha, alpha, false);
    for (float mu : {1.0f, 0.1f, 1e-2f, 1e-4f}) {
      const Vec3f wo = DirectionAt(mu, 2);
      for (uint64_t i = 0; i < 20000; ++i) {
        const auto u = CounterUniforms(5, i);
        const auto sample = SampleBsdf<kAllTraits>(fixture.bsdf, wo, u[0], {u[1], u[2]});
        if (!sample) continue;
        ASSERT_GE(sample->weight.r, 0);
        ASSERT_LE(sample->weight.r, 1 + 1e-5f) << "alpha " << alpha << " mu " << mu;
      }
    }
  }
}

// With energy compensation the two lobes are sampled separately, and no weight is exceptionally
// large.
TEST(BsdfSampleTest, MultipleScatteringWeightsStayModerate) {
  for (float alpha : {0.05f, 0.3f, 1.0f}) {
    for (const BsdfFixture& fixture :
         {MakeMirrorFixture(alpha, alpha, true), MakeDielectricFixture(alpha, alpha, 1.5f, true)}) {
      for (float mu : {1.0f, 0.1f, 1e-3f}) {
        const Vec3f wo = DirectionAt(mu, 2);
        float largest = 0;
        for (uint64_t i = 0; i < 50000; ++i) {
          const auto u = CounterUniforms(5, i);
          const auto sample = SampleBsdf<kAllTraits>(fixture.bsdf, wo, u[0], {u[1], u[2]});
          if (sample) largest = std::max(largest, sample->weight.r);
        }
        EXPECT_LE(largest, 3) << fixture.name << " mu " << mu;
      }
    }
  }
}

TEST(ChiSquareSupportTest, KnownValuesOfTheGammaFunction) {
  EXPECT_NEAR(sheaf::testing::UpperGammaQ(0.5, 0.5), 0.31731050786291415, 1e-12);  // One sigma.
  EXPECT_NEAR(sheaf::testing::UpperGammaQ(1, 3), std::exp(-3.0), 1e-12);
  EXPECT_NEAR(sheaf::testing::UpperGammaQ(50, 60), 0.0844066, 1e-6);
}

TEST(ChiSquareSupportTest, DetectsAWrongPdf) {
  const auto sample = [](std::array<float, 3> u) -> std::optional<Vec3f> {
    return SampleCosineHemisphere({u[0], u[1]});
  };
  const auto wrong = [](Vec3f w) { return w.z > 0 ? (w.z + 0.01) / (kPi * 1.02) : 0.0; };
  const ChiSquareGrid grid{21, 43, 0, 1};
  EXPECT_LT(sheaf::testing::ChiSquareTest(sample, wrong, grid, kSampleCount).p_value, 1e-6);
}

}  // namespace
}  // namespace sheaf::render
