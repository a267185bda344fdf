// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Principled Bsdfs: white furnaces, bounds of energy, limits, and agreement with the conductor,
// dielectric and diffuse materials at the corners of the parameters.
#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/principled_fixtures.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::DirectionAt;
using sheaf::testing::MakePrincipledFixture;
using sheaf::testing::WhitePrincipled;

constexpr double kFurnaceError = 0.005;
constexpr int kFurnaceSampleCount = 4000;

struct Furnace {
  Rgb albedo;
  double standard_error = 0;  // The largest of the components.
};

// Light that leaves of light from everywhere, as flux: radiance within a solid counts eta^2 times.
Furnace RunFurnace(const Bsdf& bsdf, Vec3f wo, int count) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> uniform(0, 1);
  const auto draw = [&] { return std::min(uniform(engine), 0x1.fffffep-1f); };
  double sum[3] = {}, sum2 = 0;
  for (int i = 0; i < count; ++i) {
    const float u_lobe =
        std::min((static_cast<float>(i) + draw()) / static_cast<float>(count), 0x1.fffffep-1f);
    const float u = draw(), v = draw();
    const auto sample = SampleBsdf<kAllTraits>(bsdf, wo, u_lobe, {u, v});
    if (!sample) continue;
    const Rgb weight = sample->weight * sample->eta_scale;
    EXPECT_TRUE(IsFinite(weight));
    for (size_t c = 0; c < 3; ++c) sum[c] += static_cast<double>(weight[c]);
    const double largest = static_cast<double>(MaxComponent(weight));
    sum2 += largest * largest;
  }
  Furnace furnace;
  for (size_t c = 0; c < 3; ++c) furnace.albedo[c] = static_cast<float>(sum[c] / count);
  const double mean = static_cast<double>(MaxComponent(furnace.albedo));
  furnace.standard_error = std::sqrt(std::max(0.0, sum2 / count - mean * mean) / count);
  return furnace;
}

void ExpectWhite(const PrincipledMaterial& material, const std::string& name,
                 std::vector<float> cosines = {1, 0.5f, 0.1f, -0.7f}) {
  const BsdfFixture fixture = MakePrincipledFixture(material, name);
  for (const float mu : cosines) {
    const Furnace furnace = RunFurnace(fixture.bsdf, DirectionAt(mu, 1), kFurnaceSampleCount);
    for (size_t c = 0; c < 3; ++c) {
      ExpectHardCase({.row = "M15",
                      .figure = name + " at " + InWords(mu) + " " + "rgb"[c],
                      .expected = 1,
                      .measured = furnace.albedo[c],
                      .standard_error = furnace.standard_error,
                      .tolerance = kFurnaceError});
    }
  }
}

TEST(PrincipledTest, M15_WhiteFurnaces) {
  for (const float roughness : {0.0f, 0.1f, 0.5f, 1.0f}) {
    PrincipledMaterial metal = WhitePrincipled();
    metal.roughness.value = roughness;
    PrincipledMaterial plastic = metal, glass = metal, sheet = metal;
    metal.metallic.value = 1;
    glass.transmission.value = sheet.transmission.value = 1;
    sheet.thin = true;
    const std::string at = " " + std::to_string(roughness);
    ExpectWhite(metal, "metal" + at);
    ExpectWhite(plastic, "plastic" + at);
    ExpectWhite(glass, "glass" + at);
    ExpectWhite(sheet, "sheet" + at);
    PrincipledMaterial mixed = glass;
    mixed.metallic.value = 0.3f;
    mixed.transmission.value = 0.5f;
    ExpectWhite(mixed, "mixed" + at);
    // From outside alone: a rough coat leaves light from within to the glass.
    PrincipledMaterial layered = plastic;
    layered.coat.value = 1;
    layered.coat_roughness.value = 0.3f;
    layered.sheen_color.value.rgb = Rgb::Gray(1);
    ExpectWhite(layered, "layers" + at);
    layered.transmission.value = 1;
    ExpectWhite(layered, "layers on glass" + at, {1, 0.5f, 0.1f});
    PrincipledMaterial coated_glass = glass;
    coated_glass.coat.value = 1;
    ExpectWhite(coated_glass, "smooth coat on glass" + at);
  }
}

TEST(PrincipledTest, M15_FilmsTakeNothing) {
  for (const float roughness : {0.0f, 0.4f}) {
    for (const float transmission : {0.0f, 1.0f}) {
      PrincipledMaterial film = WhitePrincipled();
      film.roughness.value = roughness;
      film.transmission.value = transmission;
      film.iridescence.value = 1;
      ExpectWhite(film, "film");
      film.thin = true;
      ExpectWhite(film, "film on a sheet");
    }
  }
}

TEST(PrincipledTest, M15_TintedGlassIsWhiteWhereItsBaseIs) {
  PrincipledMaterial glass = WhitePrincipled();
  glass.transmission.value = 1;
  glass.specular.value = 0.4f;
  glass.specular_tint.value.rgb = {0.2f, 0.5f, 1};
  for (const float roughness : {0.0f, 0.3f, 0.9f}) {
    glass.roughness.value = roughness;
    ExpectWhite(glass, "tinted glass " + std::to_string(roughness));
  }
}

// The largest albedo of random materials in random directions, which anisotropy may exceed: its
// tables are averages over azimuths.
TEST(PrincipledTest, M15_NoMoreLightThanThereWas) {
  const int material_count = DrawCount(40, 500);
  constexpr int kDirectionCount = 20, kSampleCount = 300;
  std::mt19937 engine(11);
  std::uniform_real_distribution<float> uniform(0, 1);
  const auto draw = [&] { return uniform(engine); };
  const auto some = [&] { return draw() < 0.5f ? 0.0f : draw(); };
  double largest = 0;
  for (int i = 0; i < material_count; ++i) {
    PrincipledMaterial m = WhitePrincipled();
    m.base_color.value.rgb = {draw(), 1, draw()};
    m.specular_tint.value.rgb = {1, draw(), draw()};
    m.metallic.value = some();
    m.roughness.value = draw();
    m.specular.value = draw();
    m.transmission.value = some();
    m.ior = 1 + draw();
    m.thin = draw() < 0.3f;
    m.coat.value = some();
    m.coat_roughness.value = draw();
    m.coat_ior = 1 + draw();
    m.sheen_color.value.rgb = Rgb{draw(), draw(), 1} * some();
    m.sheen_roughness.value = draw();
    m.iridescence.value = draw() < 0.2f ? draw() : 0;
    const BsdfFixture fixture = MakePrincipledFixture(m);
    for (int j = 0; j < kDirectionCount; ++j) {
      const float mu = (2 * draw() - 1) * 0.999f;
      const Furnace f = RunFurnace(fixture.bsdf, DirectionAt(mu, 6 * draw()), kSampleCount);
      const double excess = static_cast<double>(MaxComponent(f.albedo)) - 4.5 * f.standard_error;
      largest = std::max(largest, excess);
      EXPECT_LE(excess, 1 + kFurnaceError) << i << " at " << mu;
    }
  }
  ExpectHardCase({.row = "M15",
                  .figure = "the largest excess of random materials",
                  .expected = 1,
                  .measured = std::max(1.0, largest),
                  .tolerance = kFurnaceError});
}

// Value and pdf of two fixtures agree in a set of directions.
void ExpectSame(const Bsdf& a, const Bsdf& b, double tolerance) {
  for (const float mu_o : {0.9f, 0.3f, -0.6f}) {
    for (const float mu_i : {0.95f, 0.4f, -0.3f, -0.8f}) {
      const Vec3f wo = DirectionAt(mu_o, 0.3f), wi = DirectionAt(mu_i, 2.5f);
      const BsdfValue x = EvalBsdf<kAllTraits>(a, wo, wi), y = EvalBsdf<kAllTraits>(b, wo, wi);
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(x.f_cos[c], y.f_cos[c], tolerance * static_cast<double>(1e-3f + y.f_cos[c]))
            << mu_o << " " << mu_i;
      }
      EXPECT_NEAR(x.pdf, y.pdf, tolerance * static_cast<double>(1e-3f + y.pdf))
          << mu_o << " " << mu_i;
    }
  }
}

TEST(PrincipledTest, WhiteMetalIsTheMirrorOfTheConductor) {
  PrincipledMaterial metal = WhitePrincipled();
  metal.metallic.value = 1;
  metal.roughness.value = 0.6f;
  const BsdfFixture mirror = sheaf::testing::MakeMirrorFixture(0.36f, 0.36f, true);
  const BsdfFixture fixture = MakePrincipledFixture(metal);
  for (const float mu : {0.95f, 0.4f, 0.05f}) {
    const Vec3f wo = DirectionAt(0.7f, 0.3f), wi = DirectionAt(mu, 2.5f);
    const float value = EvalBsdf<kAllTraits>(fixture.bsdf, wo, wi).f_cos.g;
    EXPECT_NEAR(value, EvalBsdf<kAllTraits>(mirror.bsdf, wo, wi).f_cos.g, 1e-3f * value);
  }
}

TEST(PrincipledTest, GlassIsTheDielectric) {
  for (const float roughness : {0.3f, 0.8f}) {
    PrincipledMaterial glass = WhitePrincipled();
    glass.transmission.value = 1;
    glass.roughness.value = roughness;
    const float alpha = roughness * roughness;
    ExpectSame(MakePrincipledFixture(glass).bsdf,
               sheaf::testing::MakeDielectricFixture(alpha, alpha, 1.5f, true).bsdf, 2e-3);
    ExpectSame(MakePrincipledFixture(glass, "", true).bsdf,
               sheaf::testing::MakeDielectricFixture(alpha, alpha, 1.5f, false).bsdf, 1e-4);
  }
}

TEST(PrincipledTest, WithoutReflectionItIsDiffuse) {
  PrincipledMaterial matte = WhitePrincipled();
  matte.specular.value = 0;
  matte.base_color.value.rgb = {0.2f, 0.5f, 0.8f};
  const Bsdf diffuse = sheaf::testing::MakeDiffuseFixture({0.2f, 0.5f, 0.8f}).bsdf;
  ExpectSame(MakePrincipledFixture(matte).bsdf, diffuse, 1e-4);
  matte.specular.value = 1;
  matte.ior = 1;
  ExpectSame(MakePrincipledFixture(matte).bsdf, diffuse, 1e-4);
}

TEST(PrincipledTest, IndexOneLetsEverythingPass) {
  PrincipledMaterial nothing = WhitePrincipled();
  nothing.transmission.value = 1;
  nothing.ior = 1;
  nothing.roughness.value = 0.7f;
  for (const bool thin : {false, true}) {
    nothing.thin = thin;
    const BsdfFixture fixture = MakePrincipledFixture(nothing);
    EXPECT_TRUE(fixture.bsdf.specular);
    const Vec3f wo = DirectionAt(0.3f, 1);
    const auto sample = SampleBsdf<kAllTraits>(fixture.bsdf, wo, 0.01f, {0.4f, 0.6f});
    ASSERT_TRUE(sample.has_value());
    EXPECT_NEAR(Dot(sample->wi, wo), -1, 1e-6);
    EXPECT_NEAR(sample->weight.g, 1, 1e-6);
  }
}

// Parts of the base are reciprocal, across the boundary of glass in units of flux.
TEST(PrincipledTest, TheBaseIsReciprocal) {
  for (const bool thin : {false, true}) {
    PrincipledMaterial base = WhitePrincipled();
    base.base_color.value.rgb = {0.9f, 0.5f, 0.2f};
    base.specular_tint.value.rgb = {0.3f, 1, 0.6f};
    base.metallic.value = 0.3f;
    base.transmission.value = 0.6f;
    base.thin = thin;
    const BsdfFixture fixture = MakePrincipledFixture(base);
    const float eta2 = thin ? 1 : base.ior * base.ior;
    for (const float mu : {0.8f, 0.2f, -0.2f, -0.9f}) {
      const Vec3f a = DirectionAt(0.5f, 1), b = DirectionAt(mu, 3.5f);
      const Rgb there = EvalBsdf<kAllTraits>(fixture.bsdf, a, b).f_cos / std::fabs(b.z);
      const Rgb back = EvalBsdf<kAllTraits>(fixture.bsdf, b, a).f_cos / std::fabs(a.z);
      for (size_t c = 0; c < 3; ++c) {
        const float expected = mu < 0 ? back[c] / eta2 : back[c];
        EXPECT_NEAR(there[c], expected, 2e-3f * expected) << thin << " " << mu;
      }
    }
  }
}

// Delta lobes carry the same light, with the same probability, from either end.
TEST(PrincipledTest, DeltaLobesAreReversible) {
  PrincipledMaterial glass = WhitePrincipled();
  glass.base_color.value.rgb = {0.9f, 0.5f, 0.2f};
  glass.roughness.value = 0;
  glass.transmission.value = 0.7f;
  glass.coat.value = 0.8f;
  glass.coat_roughness.value = 0.5f;
  glass.sheen_color.value.rgb = {0.5f, 0.3f, 0.1f};
  const BsdfFixture fixture = MakePrincipledFixture(glass);
  const Vec3f wo = DirectionAt(0.6f, 1);
  constexpr int kCount = 4000;
  const auto crossing = [&](Vec3f from, Vec3f* to, Rgb* weight) {
    int count = 0;
    for (int i = 0; i < kCount; ++i) {
      const auto s = SampleBsdf<kAllTraits>(fixture.bsdf, from,
                                            (static_cast<float>(i) + 0.5f) / kCount, {0.5f, 0.5f});
      if (!s || (s->flags & kBsdfSpecular) == 0 || (s->flags & kBsdfTransmission) == 0) continue;
      ++count;
      *to = s->wi;
      *weight = s->weight * s->eta_scale;
    }
    return count;
  };
  Vec3f within, outside;
  Rgb in_weight, out_weight;
  const int in_count = crossing(wo, &within, &in_weight);
  const int out_count = crossing(within, &outside, &out_weight);
  ASSERT_GT(in_count, 100);
  EXPECT_NEAR(in_count, out_count, 3);
  EXPECT_NEAR(Dot(outside, wo), 1, 1e-5);
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(in_weight[c], out_weight[c], 1e-4f);
}

TEST(PrincipledTest, FilmsOfQuarterWavesAndOfNoThickness) {
  // A film of index sqrt(1.5 * 1) and a quarter of a wave thick reflects nothing at normal
  // incidence (Born and Wolf 1999, sec. 1.6.4).
  const ThinFilm film{std::sqrt(1.5f), 550 / (4 * std::sqrt(1.5f))};
  const Spectral nm = Spectral::Gray(550);
  EXPECT_NEAR(FilmOnDielectric(film, 1, 1.5f, nm)[0], 0, 1e-5f);
  // Without thickness it is not there.
  const ThinFilm none{1.3f, 0};
  EXPECT_NEAR(FilmOnDielectric(none, 1, 1.5f, nm)[0], 0.04f, 1e-5f);
  EXPECT_NEAR(FilmOnDielectric<Rgb>(none, 1, 1.5f, {}).g, 0.04f, 1e-3f);
  // White metal stays white below any film.
  for (const float mu : {1.0f, 0.4f, 0.0f}) {
    EXPECT_NEAR(FilmOnMetal({1.4f, 500}, mu, Spectral::Gray(1), nm)[0], 1, 1e-4f);
  }
}

}  // namespace
}  // namespace sheaf::render
