// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the sampler of principled Bsdfs against its pdf for each part and for mixtures, from both
// sides and at grazing angles; and that a sample's pdf is that of its direction.
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/chi_square.h"
#include "tests/support/principled_fixtures.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::ChiSquareGrid;
using sheaf::testing::ChiSquareResult;
using sheaf::testing::DirectionAt;
using sheaf::testing::MakePrincipledFixture;
using sheaf::testing::WhitePrincipled;

constexpr uint64_t kSampleCount = 200000;
constexpr double kSignificance = 0.01;  // For the whole file.
constexpr int kTestCount = 43;          // At least the number of chi-square tests in this file.

void ExpectSamplerMatchesPdf(const BsdfFixture& fixture, float mu, float azimuth) {
  const Vec3f wo = DirectionAt(mu, azimuth);
  const auto sample = [&](std::array<float, 3> u) -> std::optional<Vec3f> {
    const auto s = SampleBsdf<kAllTraits>(fixture.bsdf, wo, u[0], {u[1], u[2]});
    if (!s || (s->flags & kBsdfSpecular) != 0) return std::nullopt;
    const float pdf = EvalBsdf<kAllTraits>(fixture.bsdf, wo, s->wi).pdf;
    EXPECT_EQ(pdf, s->pdf) << fixture.name;
    return s->wi;
  };
  const auto pdf = [&](Vec3f wi) -> double {
    return EvalBsdf<kAllTraits>(fixture.bsdf, wo, wi).pdf;
  };
  const ChiSquareResult result = sheaf::testing::ChiSquareTest(sample, pdf, {}, kSampleCount);
  EXPECT_GE(result.p_value, sheaf::testing::SidakThreshold(kSignificance, kTestCount))
      << fixture.name << ", wo.z " << mu << ": " << result.text;
  EXPECT_LE(result.pdf_integral, 1 + 2e-3) << fixture.name << ", wo.z " << mu << result.text;
}

void ExpectSamplerMatchesPdf(const std::string& name, const PrincipledMaterial& material,
                             const std::vector<float>& cosines) {
  const BsdfFixture fixture = MakePrincipledFixture(material, name);
  for (const float mu : cosines) ExpectSamplerMatchesPdf(fixture, mu, 0.7f);
}

TEST(PrincipledChiSquareTest, Plastic) {
  PrincipledMaterial plastic = WhitePrincipled();
  plastic.base_color.value.rgb = {0.2f, 0.5f, 0.8f};
  for (const float roughness : {0.3f, 1.0f}) {
    plastic.roughness.value = roughness;
    ExpectSamplerMatchesPdf("plastic", plastic, {0.9f, 0.1f});
  }
  plastic.roughness.value = 0;
  ExpectSamplerMatchesPdf("smooth plastic", plastic, {0.5f});
}

TEST(PrincipledChiSquareTest, MetalWithTurnedGrain) {
  PrincipledMaterial metal = WhitePrincipled();
  metal.base_color.value.rgb = {0.9f, 0.6f, 0.3f};
  metal.metallic.value = 1;
  metal.anisotropy.value = 0.8f;
  metal.rotation_radians.value = 0.6f;
  ExpectSamplerMatchesPdf("metal", metal, {0.8f, 0.05f, -0.6f});
}

TEST(PrincipledChiSquareTest, SolidAndThinGlass) {
  PrincipledMaterial glass = WhitePrincipled();
  glass.base_color.value.rgb = {0.3f, 0.9f, 0.5f};
  glass.specular_tint.value.rgb = {1, 0.5f, 0.2f};
  glass.transmission.value = 1;
  for (const float roughness : {0.4f, 1.0f}) {
    glass.roughness.value = roughness;
    ExpectSamplerMatchesPdf("glass", glass, {0.9f, 0.1f, -0.9f, -0.3f});
  }
  glass.thin = true;
  ExpectSamplerMatchesPdf("sheet", glass, {0.7f, -0.2f});
}

TEST(PrincipledChiSquareTest, Layers) {
  PrincipledMaterial layers = WhitePrincipled();
  layers.base_color.value.rgb = {0.7f, 0.3f, 0.1f};
  layers.metallic.value = 0.4f;
  layers.transmission.value = 0.5f;
  layers.coat.value = 0.8f;
  layers.coat_roughness.value = 0.4f;
  layers.sheen_color.value.rgb = {0.2f, 0.6f, 0.4f};
  layers.iridescence.value = 0.7f;
  ExpectSamplerMatchesPdf("layers", layers, {0.9f, 0.3f, 0.01f, -0.5f});
  layers.coat_roughness.value = 0;
  layers.thin = true;
  ExpectSamplerMatchesPdf("thin layers", layers, {0.6f, -0.4f});
  layers.roughness.value = 0;
  ExpectSamplerMatchesPdf("smooth layers", layers, {0.6f});
}

// The coat of a rough base has a normal of its own.
TEST(PrincipledChiSquareTest, TiltedCoats) {
  PrincipledMaterial lacquer = WhitePrincipled();
  lacquer.base_color.value.rgb = {0.7f, 0.3f, 0.1f};
  lacquer.coat.value = 0.8f;
  lacquer.coat_roughness.value = 0.3f;
  lacquer.sheen_color.value.rgb = {0.1f, 0.2f, 0.1f};
  BsdfFixture fixture = MakePrincipledFixture(lacquer, "lacquer");
  fixture.bsdf.coat_tilt = CoatTilt::Of(Normalize(Vec3f{0.4f, -0.3f, 1}));
  for (const float mu : {0.9f, 0.3f, -0.5f}) ExpectSamplerMatchesPdf(fixture, mu, 0.7f);
}

TEST(PrincipledChiSquareTest, SheenOfAllRoughnesses) {
  for (const float roughness : {0.0f, 0.3f, 1.0f}) {
    PrincipledMaterial cloth = WhitePrincipled();
    cloth.sheen_color.value.rgb = Rgb::Gray(1);
    cloth.sheen_roughness.value = roughness;
    ExpectSamplerMatchesPdf("sheen", cloth, {0.7f, 0.05f});
  }
}

}  // namespace
}  // namespace sheaf::render
