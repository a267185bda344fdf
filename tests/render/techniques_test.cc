// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests techniques that must have the same expectation: light found by light sampling, by BSDF
// sampling, and by both; lights chosen by the light tree and uniformly; RGB and spectral transport
// of gray scenes. technique_agreement.h says how they are compared.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/support/hard_case.h"
#include "tests/support/technique_agreement.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/integrator/render_row.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Agreement;
using sheaf::testing::Bias;
using sheaf::testing::BiasOfNoisyPair;
using sheaf::testing::Compare;
using sheaf::testing::EstimatesOf;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;

constexpr uint64_t kFewSamples = 64, kManySamples = 128;

constexpr int32_t kDepth = 4;

std::vector<TestScene> LitScenes(Tint tint) {
  return {Diffuse(tint), Glossy(tint), Outdoor(tint), Hazy(tint)};
}
std::vector<TestScene> AllScenes(Tint tint) {
  std::vector<TestScene> scenes = LitScenes(tint);
  scenes.push_back(ManyLights(tint));
  return scenes;
}

// --- Techniques ----------------------------------------------------------------------------------

struct Technique {
  DirectLight direct_light = DirectLight::kByBoth;
  bool choose_lights_evenly = false;
  EquiangularMode equiangular_mode = EquiangularMode::kWhereEfficient;
  ColorTransport color = ColorTransport::kRgb;
};

template <DirectLight kDirectLight>
void RenderPixels(const CompiledScene& scene, PixelAccumulator* accumulator) {
  const FrameSettings& settings = SettingsOf(scene);
  RayCounts counts;
  PathIntegrator<kAllTraits, const EmbreeScene, kDirectLight> tracer(scene, *scene.tracer, counts);
  for (int32_t y = settings.window.y0; y < settings.window.y1; ++y) {
    for (int32_t x = settings.window.x0; x < settings.window.x1; ++x) {
      accumulator->Begin(x, y);
      for (uint64_t s = 0; s < settings.samples; ++s) {
        accumulator->Add(s, tracer.TraceSample(x, y, s));
      }
      accumulator->End();
    }
  }
}

FilmTile Render(const TestScene& test_scene, const Technique& technique, uint64_t seed,
                uint64_t samples) {
  FrameSettings settings = SquareSettings(kSizePx, samples, kDepth);
  settings.seed = seed;
  settings.color = technique.color;
  TableFileSource files({});
  CompileLimits limits;
  limits.build_threads = 1;
  absl::StatusOr<CompiledScenePtr> compiled =
      CompileScene(test_scene.scene, settings, files, limits,
                   {.choose_lights_evenly = technique.choose_lights_evenly,
                    .equiangular_mode = technique.equiangular_mode});
  EXPECT_TRUE(compiled.ok()) << compiled.status();
  const CompiledScene& scene = **compiled;
  if (technique.direct_light == DirectLight::kByBoth) return RenderAll(scene);
  EXPECT_EQ(technique.color, ColorTransport::kRgb);
  FilmTile tile(settings.window, {0, settings.samples});
  PixelAccumulator accumulator(&tile);
  if (technique.direct_light == DirectLight::kBySampling) {
    RenderPixels<DirectLight::kBySampling>(scene, &accumulator);
  } else if (technique.direct_light == DirectLight::kByEquiangular) {
    RenderPixels<DirectLight::kByEquiangular>(scene, &accumulator);
  } else {
    RenderPixels<DirectLight::kByHitting>(scene, &accumulator);
  }
  EXPECT_TRUE(accumulator.non_finite().empty());
  return tile;
}

std::vector<TilePair> TilePairs(const std::vector<TestScene>& scenes, const Technique& a,
                                const Technique& b, uint64_t seed,
                                uint64_t samples_in_short = kManySamples) {
  const uint64_t samples = Samples(samples_in_short);
  std::vector<TilePair> tiles;
  for (size_t i = 0; i < scenes.size(); ++i) {
    const auto of_a = EstimatesOf(Render(scenes[i], a, seed + 2 * i, samples));
    const auto of_b = EstimatesOf(Render(scenes[i], b, seed + 2 * i + 1, samples));
    for (size_t tile = 0; tile < of_a.size(); ++tile) tiles.push_back({of_a[tile], of_b[tile]});
  }
  return tiles;
}

constexpr Technique kBoth{};
constexpr Tint kColored{1}, kGray{0};

// Scenes with large lights, so that BSDF samples hit them often enough to measure.
TEST(TechniquesTest, L16SampledLightAndBoth) {
  ExpectAgreement("both against sampling", Bias(),
                  TilePairs(LitScenes(kColored), kBoth, {.direct_light = DirectLight::kBySampling},
                            100, kFewSamples));
}
TEST(TechniquesTest, L16HitLightAndBoth) {
  ExpectAgreement(
      "both against meeting", Bias(),
      TilePairs(LitScenes(kColored), kBoth, {.direct_light = DirectLight::kByHitting}, 200));
}
TEST(TechniquesTest, V10EmissionSampledAndHit) {
  const std::vector<TestScene> scenes = {Burning(kColored)};
  ExpectAgreement("glow: both against sampling", BiasOfNoisyPair(),
                  TilePairs(scenes, kBoth, {.direct_light = DirectLight::kBySampling}, 400));
  ExpectAgreement("glow: both against meeting", Bias(),
                  TilePairs(scenes, kBoth, {.direct_light = DirectLight::kByHitting}, 420));
}
TEST(TechniquesTest, L16SampledAndHitLight) {
  const std::vector<TilePair> tiles =
      TilePairs(LitScenes(kColored), {.direct_light = DirectLight::kBySampling},
                {.direct_light = DirectLight::kByHitting}, 300);
  ExpectAgreement("sampling against meeting", BiasOfNoisyPair(), tiles);
  double sampled = 0, hit_light = 0, variance = 0;
  for (const TilePair& tile : tiles) {
    sampled += tile.a.mean;
    hit_light += tile.b.mean;
    variance += tile.a.variance + tile.b.variance;
  }
  ExpectHardCase({.row = "L16",
                  .figure = "light that is met over light that is sampled",
                  .expected = 1,
                  .measured = hit_light / sampled,
                  .standard_error = std::sqrt(variance) / sampled,
                  .naive = (hit_light + sampled) / sampled,
                  .naive_by = "both added without weights"});
}

// The same scene several times, for statistical power.
std::vector<TestScene> FoggyScenes() { return std::vector<TestScene>(4, Foggy(kColored)); }
// Compares, in fog, equiangular samples, distance samples with light sampling at their ends, and
// both.
TEST(TechniquesTest, V7EquiangularAndAllTechniques) {
  ExpectAgreement("all against lines", 1.5 * Bias(),
                  TilePairs(FoggyScenes(), kBoth, {.direct_light = DirectLight::kByEquiangular},
                            600, kFewSamples));
}
TEST(TechniquesTest, V7DistanceSamplingAndAllTechniques) {
  ExpectAgreement("all against flights", BiasOfNoisyPair(),
                  TilePairs(FoggyScenes(), kBoth, {.direct_light = DirectLight::kBySampling}, 700,
                            kFewSamples));
}

// The same in heterogeneous media, also with the decision per segment whether it is sampled.
constexpr EquiangularMode kAlways = EquiangularMode::kAlways, kNever = EquiangularMode::kNever;
std::vector<TestScene> CloudyScenes() { return std::vector<TestScene>(2, Cloudy(kColored)); }
TEST(TechniquesTest, V7EquiangularInCloudsAndAllTechniques) {
  ExpectAgreement(
      "clouds: all against lines", 1.5 * Bias(),
      TilePairs(CloudyScenes(), {.equiangular_mode = kAlways},
                {.direct_light = DirectLight::kByEquiangular, .equiangular_mode = kAlways}, 800));
}
TEST(TechniquesTest, V7DistanceSamplingInCloudsAndAllTechniques) {
  ExpectAgreement("clouds: all against flights", BiasOfNoisyPair(),
                  TilePairs(CloudyScenes(), {.equiangular_mode = kAlways},
                            {.direct_light = DirectLight::kBySampling}, 820));
}
TEST(TechniquesTest, V7EquiangularInCloudsWhereEfficient) {
  ExpectAgreement("clouds: where it pays against nowhere", BiasOfNoisyPair(),
                  TilePairs(CloudyScenes(), kBoth, {.equiangular_mode = kNever}, 840));
}
TEST(TechniquesTest, V7EquiangularInSpectralClouds) {
  ExpectAgreement(
      "clouds: RGB against spectra", BiasOfNoisyPair(),
      TilePairs(std::vector<TestScene>(2, Cloudy(kGray)), {.equiangular_mode = kAlways},
                {.equiangular_mode = kAlways, .color = ColorTransport::kSpectral}, 860));
}

TEST(TechniquesTest, LightsByImportanceAndUniformly) {
  ExpectAgreement(
      "importance against even choice", Bias(),
      TilePairs(AllScenes(kColored), kBoth, {.choose_lights_evenly = true}, 400, kFewSamples));
}

TEST(TechniquesTest, SpectralAndRgbTransportOfGrayScenes) {
  ExpectAgreement(
      "RGB against spectra", Bias(),
      TilePairs(AllScenes(kGray), kBoth, {.color = ColorTransport::kSpectral}, 500, kFewSamples));
}

// --- Test tools ----------------------------------------------------------------------------------

TEST(AgreementTest, StudentCdfHasTabulatedValues) {
  EXPECT_NEAR(sheaf::testing::StudentCdf(0, 7), 0.5, 1e-14);
  EXPECT_NEAR(sheaf::testing::StudentCdf(1, 1), 0.75, 1e-12);  // Cauchy: 1/2 + atan(t) / pi.
  EXPECT_NEAR(sheaf::testing::StudentCdf(-1, 2), 0.5 - 0.5 / std::sqrt(3.0), 1e-12);
  EXPECT_NEAR(sheaf::testing::StudentCdf(1.812461122811676, 10), 0.95, 1e-9);
  EXPECT_NEAR(sheaf::testing::StudentCdf(-2.749995653567231, 30), 0.005, 1e-9);
}

TEST(AgreementTest, UniformityMatchesTheDistribution) {
  std::vector<double> even, low;
  for (int i = 0; i < 1000; ++i) {
    even.push_back((i + 0.5) / 1000);
    low.push_back(even.back() * 0.95);
  }
  EXPECT_NEAR(sheaf::testing::UniformityP(even), 1, 1e-12);
  // A distance of 0.05: Kolmogorov's 2 sum (-1)^(j-1) exp(-2 j^2 (sqrt(n) D)^2) with Stephens' n.
  EXPECT_NEAR(sheaf::testing::UniformityP(low), 0.0132, 0.0015);
}

// Draws from one distribution give uniform p-values; the false-alarm rate equals the significance.
TEST(AgreementTest, FalseAlarmRateEqualsTheSignificance) {
  std::vector<TilePair> tiles;
  for (int i = 1; i <= 100; ++i) {
    tiles.push_back({{1, 1e-4 * i, 16}, {1, 1e-4, 16}});
  }
  const int redraws = 2000;
  const double rate = sheaf::testing::PowerOf(tiles, 0, 0.05, redraws);
  EXPECT_NEAR(rate, 0.05, 5 * std::sqrt(0.05 * 0.95 / redraws));
}

}  // namespace
}  // namespace sheaf::render
