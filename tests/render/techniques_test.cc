// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests techniques that must have the same expectation: light found by light sampling, by BSDF
// sampling, and by both; lights chosen by the light tree and uniformly; RGB and spectral transport
// of gray scenes. Each scene is rendered by two techniques from independent seeds and compared tile
// by tile. Pixels and replicates are independent, so the 16 replicates of a tile are 16 draws for
// Welch's t-test, and the p-values of all tiles of all scenes must be uniform.
//
// Significance: kSignificance for each pair of techniques, for the Kolmogorov-Smirnov test and for
// the most deviating tile (the seeds are fixed: a test that passes once always passes). Power: a
// bias of Bias() must be detected with probability kPowerMin at that significance, in draws with
// the variances of the actual renderings, and when it is added to the renderings themselves.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/support/agreement.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/integrator/render_row.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

using testing::Agreement;
using testing::Compare;
using testing::TilePair;

constexpr double kSignificance = 1e-3;
constexpr double kPowerMin = 0.99;
// The bias that must be detected; a larger one for two techniques that are both noisy somewhere.
double Bias() { return LongTests() ? 0.0025 : 0.01; }
double BiasOfNoisyPair() { return 1.5 * Bias(); }
// As many per pixel as the power needs: ExpectAgreement fails if they are too few.
uint64_t Samples(uint64_t in_short) { return LongTests() ? 2048 : in_short; }
constexpr uint64_t kFewSamples = 64, kManySamples = 128;

constexpr int32_t kSizePx = 48, kTileSizePx = 6, kDepth = 4;

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

// Estimates of the sum of the channels in each tile; the box filter gives every sample the same
// weight.
std::vector<testing::Estimate> EstimatesOf(const FilmTile& film) {
  std::vector<testing::Estimate> estimates;
  for (int32_t y0 = 0; y0 < kSizePx; y0 += kTileSizePx) {
    for (int32_t x0 = 0; x0 < kSizePx; x0 += kTileSizePx) {
      std::vector<double> draws;
      for (uint32_t r = 0; r < film.replicate_count(); ++r) {
        double sum = 0, weight = 0;
        for (int32_t y = y0; y < y0 + kTileSizePx; ++y) {
          for (int32_t x = x0; x < x0 + kTileSizePx; ++x) {
            const auto pixel = static_cast<size_t>(y * kSizePx + x);
            for (size_t c = 0; c < 3; ++c) sum += static_cast<double>(film.replicate(r, c)[pixel]);
            weight += static_cast<double>(film.replicate(r, 3)[pixel]);
          }
        }
        draws.push_back(sum / weight);
      }
      estimates.push_back(testing::EstimateOf(draws));
    }
  }
  return estimates;
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

// The techniques agree, and a disagreement would have been detected.
void ExpectAgreement(const std::string& name, double bias, const std::vector<TilePair>& tiles) {
  const Agreement agreement = Compare(tiles);
  EXPECT_GT(agreement.uniformity_p, kSignificance) << agreement.text;
  EXPECT_GT(agreement.extreme_p, kSignificance) << agreement.text;
  const double power_up = testing::PowerOf(tiles, bias, kSignificance);
  const double power_down = testing::PowerOf(tiles, -bias, kSignificance);
  EXPECT_GE(power_up, kPowerMin);
  EXPECT_GE(power_down, kPowerMin);
  for (const double planted : {bias, -bias}) {
    const Agreement biased = Compare(tiles, planted);
    EXPECT_LT(biased.uniformity_p, kSignificance) << "planted " << planted << ": " << biased.text;
  }
  std::printf("%s: %s; a bias of %.2f %% found with probability %.3f\n", name.c_str(),
              agreement.text.c_str(), 100 * bias, std::min(power_up, power_down));
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
  EXPECT_NEAR(testing::StudentCdf(0, 7), 0.5, 1e-14);
  EXPECT_NEAR(testing::StudentCdf(1, 1), 0.75, 1e-12);  // Cauchy: 1/2 + atan(t) / pi.
  EXPECT_NEAR(testing::StudentCdf(-1, 2), 0.5 - 0.5 / std::sqrt(3.0), 1e-12);
  EXPECT_NEAR(testing::StudentCdf(1.812461122811676, 10), 0.95, 1e-9);
  EXPECT_NEAR(testing::StudentCdf(-2.749995653567231, 30), 0.005, 1e-9);
}

TEST(AgreementTest, UniformityMatchesTheDistribution) {
  std::vector<double> even, low;
  for (int i = 0; i < 1000; ++i) {
    even.push_back((i + 0.5) / 1000);
    low.push_back(even.back() * 0.95);
  }
  EXPECT_NEAR(testing::UniformityP(even), 1, 1e-12);
  // A distance of 0.05: Kolmogorov's 2 sum (-1)^(j-1) exp(-2 j^2 (sqrt(n) D)^2) with Stephens' n.
  EXPECT_NEAR(testing::UniformityP(low), 0.0132, 0.0015);
}

// Draws from one distribution give uniform p-values; the false-alarm rate equals the significance.
TEST(AgreementTest, FalseAlarmRateEqualsTheSignificance) {
  std::vector<TilePair> tiles;
  for (int i = 1; i <= 100; ++i) {
    tiles.push_back({{1, 1e-4 * i, 16}, {1, 1e-4, 16}});
  }
  const int redraws = 2000;
  const double rate = testing::PowerOf(tiles, 0, 0.05, redraws);
  EXPECT_NEAR(rate, 0.05, 5 * std::sqrt(0.05 * 0.95 / redraws));
}

}  // namespace
}  // namespace sheaf::render
