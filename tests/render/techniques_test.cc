// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Techniques that must have one expectation have it: light found by sampling it, by meeting it, and
// by both; lights chosen by a hierarchy and evenly; colour as RGB and as spectra where all is grey.
// Each scene is rendered by two techniques from independent seeds, tile by tile. Pixels and
// replicates are independent, so the 16 replicates of a tile are 16 draws for Welch's t-test, and
// the p-values of all tiles of all scenes must be uniform.
//
// Significance: kSignificance for each pair of techniques, for the Kolmogorov-Smirnov test and for
// the tile furthest off (the seeds are fixed: what passes once always passes). Power: a bias of
// Bias() must be found with probability kPowerMin at that significance, redrawn with the variances
// of the very renders; and it is found when it is planted in them.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/support/agreement.h"
#include "tests/support/long_tests.h"
#include "tests/support/test_scene.h"
#include "worker/render/render_row.h"
#include "worker/render/variant_list.h"

namespace sheaf::render {
namespace {

using testing::Agreement;
using testing::Compare;
using testing::TilePair;

constexpr double kSignificance = 1e-3;
constexpr double kPowerMin = 0.99;
// The bias that must be found; of two techniques that are each noisy somewhere, a larger one.
double Bias() { return LongTests() ? 0.0025 : 0.01; }
double BiasOfNoisyPair() { return 1.5 * Bias(); }
uint64_t Samples() { return LongTests() ? 2048 : 128; }

constexpr int32_t kSizePx = 48, kTileSizePx = 6, kDepth = 4;

// --- Scenes --------------------------------------------------------------------------------------

// Colours are mixed with grey so far; 0 makes all grey.
struct Tint {
  float share = 0;
  Rgb operator()(Rgb c) const {
    const float grey = (c.r + c.g + c.b) / 3;
    return Rgb::Grey(grey * (1 - share)) + c * share;
  }
};

// The picture ends below the height of the lamps: where a lamp is seen edge on, meeting it is so
// rare that the draws of a tile are far from normal.
TestScene OpenBox(Tint tint) {
  TestScene t({0, 1, -3.2}, {0, 0.6, 0}, 36);
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse(tint({0.6f, 0.5f, 0.4f})));
  t.AddShape(MeshShape{t.Quad({-2, 0, 2}, {-2, 3, 2}, {2, 3, 2}, {2, 0, 2})},
             t.Diffuse(tint({0.3f, 0.5f, 0.7f})));
  return t;
}

void AddLamp(TestScene* t, Tint tint, float half_width) {
  const float w = half_width;
  t->AddShape(MeshShape{t->Quad({-w, 2.5f, -w}, {w, 2.5f, -w}, {w, 2.5f, w}, {-w, 2.5f, w})},
              t->Diffuse({}))
      .area_light = t->AreaLight(tint({6, 5, 4}));
}

const SphereShape kBall{0.6f, -0.6f, 0.6f, 360};

// A lamp, a lamp that is a ball, and diffuse surfaces.
TestScene Diffuse(Tint tint) {
  TestScene t = OpenBox(tint);
  AddLamp(&t, tint, 0.9f);
  t.AddShape(SphereShape{0.4f, -0.4f, 0.4f, 360}, t.Diffuse({}), TranslateMatrix({-1.2, 0.6, 0.5}))
      .area_light = t.AreaLight(tint({2, 3, 4}));
  t.AddShape(kBall, t.Diffuse(tint({0.7f, 0.7f, 0.3f})), TranslateMatrix({0.5, 0.6, 0}));
  return t;
}

// Rough metal, a rough coat, rough glass: wide lobes, for those that are narrow are met by samples
// of light too rarely for 16 draws to know their own variance.
TestScene Glossy(Tint tint) {
  TestScene t = OpenBox(tint);
  AddLamp(&t, tint, 1);
  ConductorMaterial metal;
  metal.roughness = {{0.5f, kNone}, {0.4f, kNone}, true};
  metal.has_reflectance = true;
  metal.reflectance.value.rgb = tint({0.9f, 0.7f, 0.5f});
  CoatedDiffuseMaterial coat;
  coat.roughness = {{0.5f, kNone}, {0.5f, kNone}, true};
  coat.reflectance.value.rgb = tint({0.2f, 0.5f, 0.6f});
  DielectricMaterial glass;
  glass.roughness = {{0.8f, kNone}, {0.8f, kNone}, true};
  t.AddShape(kBall, t.AddMaterial(metal), TranslateMatrix({-1.25, 0.6, 0.3}));
  t.AddShape(kBall, t.AddMaterial(coat), TranslateMatrix({0, 0.6, 0.6}));
  t.AddShape(kBall, t.AddMaterial(glass), TranslateMatrix({1.25, 0.6, 0.3}));
  return t;
}

// A sky, a lamp without size, leaves, a lens, a cut-out, and a ball that moves.
TestScene Outdoor(Tint tint) {
  TestScene t = OpenBox(tint);
  t.ConstantEnvironment(tint({0.6f, 0.8f, 1}));
  PointLight lamp;
  lamp.intensity.rgb = tint({2, 2, 1});
  lamp.from = {1, 2, -1};
  t.scene.lights.push_back({lamp, {}, {}, {}});
  t.scene.camera.lens_radius = 0.05f;
  t.scene.camera.focal_distance = 3.5f;
  t.scene.camera.shutter_close = 1;
  DiffuseTransmissionMaterial leaf;
  leaf.reflectance.value.rgb = tint({0.2f, 0.4f, 0.1f});
  leaf.transmittance.value.rgb = tint({0.1f, 0.4f, 0.1f});
  t.AddShape(MeshShape{t.Quad({-1.5f, 0.4f, 0}, {-0.5f, 0.4f, 0.4f}, {-0.5f, 1.4f, 0.4f},
                              {-1.5f, 1.4f, 0})},
             t.AddMaterial(leaf));
  ShapeDescription& lace =
      t.AddShape(kBall, t.Diffuse(tint({0.7f, 0.3f, 0.3f})), TranslateMatrix({0.2, 0.6, 0.6}));
  lace.has_alpha = true;
  lace.alpha.value = 0.6f;
  ShapeDescription& moving =
      t.AddShape(kBall, t.Diffuse(tint({0.3f, 0.3f, 0.7f})), TranslateMatrix({1.1, 0.6, 0.2}));
  moving.world_from_object.end = TranslateMatrix({1.1, 1.0, 0.2});
  return t;
}

// Two volumes that overlap, with a colour and a phase function each, one of them glowing; a lamp
// and a sky that light them through their own surfaces.
TestScene Hazy(Tint tint) {
  TestScene t = OpenBox(tint);
  AddLamp(&t, tint, 1);
  t.ConstantEnvironment(tint({0.3f, 0.4f, 0.5f}));
  const auto add = [&](Rgb sigma_a, Rgb sigma_s, float g, Matrix4 place) {
    MediumDescription medium;
    medium.sigma_a.rgb = tint(sigma_a);
    medium.sigma_s.rgb = tint(sigma_s);
    medium.g = g;
    t.AddShape(kBall, t.AddMaterial(InterfaceMaterial{}), place).media.inside =
        static_cast<int32_t>(t.scene.media.size());
    t.scene.media.push_back(medium);
  };
  add({0.2f, 0.1f, 0.4f}, {1, 2, 3}, 0.4f, TranslateMatrix({-0.4, 0.7, 0.2}));
  add({0.1f, 0.3f, 0}, {2, 1, 0.5f}, -0.3f, TranslateMatrix({0.4, 0.7, 0}));
  t.scene.media[1].emits = true;
  t.scene.media[1].radiance.rgb = tint({0.5f, 0.3f, 0.1f});
  return t;
}

// A lumpy cloud that shines by factors of a colour and scatters, above a floor, in a haze that
// shines a little; and a second one that is only bright.
TestScene Burning(Tint tint) {
  TestScene t = OpenBox(tint);
  t.ConstantEnvironment(tint({0.05f, 0.06f, 0.08f}));
  const auto add = [&](MediumDescription medium, Vec3f lower, Vec3f upper) {
    t.AddShape(MeshShape{t.Box(lower, upper)}, t.AddMaterial(InterfaceMaterial{})).media.inside =
        static_cast<int32_t>(t.scene.media.size());
    t.scene.media.push_back(std::move(medium));
  };
  const auto shining = [&](Rgb sigma_a, Rgb sigma_s, Rgb radiance) {
    MediumDescription medium;
    medium.sigma_a.rgb = tint(sigma_a);
    medium.sigma_s.rgb = tint(sigma_s);
    medium.g = 0.3f;
    medium.emits = true;
    medium.radiance.rgb = tint(radiance);
    return medium;
  };
  const auto lumps = [](Vec3d lower, Vec3d upper) {
    UniformGridMedium grid;
    grid.box = {{4, 4, 4}, lower, upper};
    for (int i = 0; i < 64; ++i) {
      grid.density.push_back(i % 3 == 0 ? 0.0f : 0.25f * static_cast<float>(i % 7));
      grid.radiance_scale.push_back(static_cast<float>(i % 5));
    }
    return grid;
  };
  MediumDescription fire = shining({1, 0.6f, 0.8f}, {0.5f, 0.8f, 1}, {0.5f, 0.4f, 0.2f});
  fire.kind = lumps({-0.9, 0.1, -0.6}, {0.3, 1.5, 0.6});
  add(std::move(fire), {-0.9f, 0.1f, -0.6f}, {0.3f, 1.5f, 0.6f});
  MediumDescription bright = shining({0.4f, 0.5f, 0.3f}, {}, {0.2f, 0.6f, 0.9f});
  bright.kind = lumps({0.6, 0.3, -0.5}, {1.6, 1.3, 0.5});
  add(std::move(bright), {0.6f, 0.3f, -0.5f}, {1.6f, 1.3f, 0.5f});
  add(shining({0.02f, 0.03f, 0.04f}, {0.05f, 0.05f, 0.1f}, {0.3f, 0.2f, 0.2f}),
      {-1.95f, 0.05f, -1.9f}, {1.95f, 2.5f, 1.9f});
  return t;
}

// A room full of fog of two kinds, a part of which overlaps, with a lamp of each sort that has a
// place: flat ones, a ball, a point and a cone.
TestScene Foggy(Tint tint) {
  TestScene t = Diffuse(tint);
  PointLight point;
  point.intensity.rgb = tint({0.8f, 0.6f, 0.4f});
  point.from = {1, 1.4f, -0.5f};
  t.scene.lights.push_back({point, {}, {}, {}});
  SpotLight spot;
  spot.intensity.rgb = tint({3, 4, 5});
  spot.from = {-0.3f, 2, -0.6f};
  spot.to = {0.2f, 0, 0.2f};
  t.scene.lights.push_back({spot, {}, {}, {}});
  const auto add = [&](Rgb sigma_a, Rgb sigma_s, float g, Vec3f lower, Vec3f upper) {
    MediumDescription medium;
    medium.sigma_a.rgb = tint(sigma_a);
    medium.sigma_s.rgb = tint(sigma_s);
    medium.g = g;
    t.AddShape(MeshShape{t.Box(lower, upper)}, t.AddMaterial(InterfaceMaterial{})).media.inside =
        static_cast<int32_t>(t.scene.media.size());
    t.scene.media.push_back(medium);
  };
  add({0.02f, 0.05f, 0.1f}, {0.1f, 0.2f, 0.3f}, 0.5f, {-2.5f, -0.5f, -2.4f}, {2.5f, 3.5f, 2.5f});
  add({0.1f, 0, 0}, {0.8f, 0.4f, 0.2f}, -0.2f, {-1, 0.1f, -1}, {1, 1.6f, 1});
  return t;
}

// More lights than are weighed one by one: rows of small lamps of unlike power, one of them without
// size, and a dim sky.
TestScene ManyLamps(Tint tint) {
  TestScene t = OpenBox(tint);
  t.ConstantEnvironment(tint({0.02f, 0.03f, 0.05f}));
  PointLight lamp;
  lamp.intensity.rgb = tint({0.5f, 0.3f, 0.2f});
  lamp.from = {-1, 1.5f, 0};
  t.scene.lights.push_back({lamp, {}, {}, {}});
  for (int i = 0; i < 20; ++i) {
    const float x = -1.8f + 0.9f * static_cast<float>(i % 5);
    const float z = -1.5f + 1.0f * static_cast<float>(i / 5);
    const float strength = 1.0f + static_cast<float>(i * 7 % 10);
    t.AddShape(MeshShape{t.Quad({x, 2.2f, z}, {x + 0.2f, 2.2f, z}, {x + 0.2f, 2.2f, z + 0.2f},
                                {x, 2.2f, z + 0.2f})},
               t.Diffuse({}))
        .area_light = t.AreaLight(tint({strength, strength, 0.5f * strength}));
  }
  t.AddShape(kBall, t.Diffuse(tint({0.7f, 0.7f, 0.3f})), TranslateMatrix({0.5, 0.6, 0}));
  return t;
}

std::vector<TestScene> LitScenes(Tint tint) {
  return {Diffuse(tint), Glossy(tint), Outdoor(tint), Hazy(tint)};
}
std::vector<TestScene> AllScenes(Tint tint) {
  std::vector<TestScene> scenes = LitScenes(tint);
  scenes.push_back(ManyLamps(tint));
  return scenes;
}

// --- Techniques ----------------------------------------------------------------------------------

struct Technique {
  DirectLight direct_light = DirectLight::kByBoth;
  bool choose_lights_evenly = false;
  ColorTransport color = ColorTransport::kRgb;
};

template <DirectLight kDirectLight>
void RenderPixels(const CompiledScene& scene, PixelAccumulator* accumulator) {
  const FrameSettings& settings = SettingsOf(scene);
  RayCounts counts;
  PathTracer<kAllTraits, const EmbreeScene, kDirectLight> tracer(scene, *scene.tracer, counts);
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

FilmTile Render(const TestScene& test_scene, const Technique& technique, uint64_t seed) {
  FrameSettings settings = SquareSettings(kSizePx, Samples(), kDepth);
  settings.seed = seed;
  settings.color = technique.color;
  TableFileSource files({});
  CompileLimits limits;
  limits.build_threads = 1;
  absl::StatusOr<CompiledScenePtr> compiled =
      CompileScene(test_scene.scene, settings, files, limits,
                   {.choose_lights_evenly = technique.choose_lights_evenly});
  EXPECT_TRUE(compiled.ok()) << compiled.status();
  const CompiledScene& scene = **compiled;
  if (technique.direct_light == DirectLight::kByBoth) return RenderAll(scene);
  EXPECT_EQ(technique.color, ColorTransport::kRgb);
  FilmTile tile(settings.window, {0, settings.samples});
  PixelAccumulator accumulator(&tile);
  if (technique.direct_light == DirectLight::kBySampling) {
    RenderPixels<DirectLight::kBySampling>(scene, &accumulator);
  } else if (technique.direct_light == DirectLight::kByLines) {
    RenderPixels<DirectLight::kByLines>(scene, &accumulator);
  } else {
    RenderPixels<DirectLight::kByMeeting>(scene, &accumulator);
  }
  EXPECT_TRUE(accumulator.non_finite().empty());
  return tile;
}

// Of the sum of the channels in each tile; the box filter gives every sample the same weight.
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
                                const Technique& b, uint64_t seed) {
  std::vector<TilePair> tiles;
  for (size_t i = 0; i < scenes.size(); ++i) {
    const auto of_a = EstimatesOf(Render(scenes[i], a, seed + 2 * i));
    const auto of_b = EstimatesOf(Render(scenes[i], b, seed + 2 * i + 1));
    for (size_t tile = 0; tile < of_a.size(); ++tile) tiles.push_back({of_a[tile], of_b[tile]});
  }
  return tiles;
}

// The techniques agree, and had they not, it would have been seen.
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
constexpr Tint kColored{1}, kGrey{0};

// Scenes of large lights, so that meeting them by chance is not too rare to measure.
TEST(TechniquesTest, L16LightSampledAndLightMetBoth) {
  ExpectAgreement(
      "both against sampling", Bias(),
      TilePairs(LitScenes(kColored), kBoth, {.direct_light = DirectLight::kBySampling}, 100));
}
TEST(TechniquesTest, L16LightMetAndLightSampledBoth) {
  ExpectAgreement(
      "both against meeting", Bias(),
      TilePairs(LitScenes(kColored), kBoth, {.direct_light = DirectLight::kByMeeting}, 200));
}
TEST(TechniquesTest, V10GlowSampledAndGlowMet) {
  const std::vector<TestScene> scenes = {Burning(kColored)};
  ExpectAgreement("glow: both against sampling", BiasOfNoisyPair(),
                  TilePairs(scenes, kBoth, {.direct_light = DirectLight::kBySampling}, 400));
  ExpectAgreement("glow: both against meeting", Bias(),
                  TilePairs(scenes, kBoth, {.direct_light = DirectLight::kByMeeting}, 420));
}
TEST(TechniquesTest, L16LightSampledAndLightMet) {
  ExpectAgreement("sampling against meeting", BiasOfNoisyPair(),
                  TilePairs(LitScenes(kColored), {.direct_light = DirectLight::kBySampling},
                            {.direct_light = DirectLight::kByMeeting}, 300));
}

// The same several times, for power.
std::vector<TestScene> FoggyScenes() { return std::vector<TestScene>(4, Foggy(kColored)); }
// In fog: light gathered along lines, by flights that end where light is sampled, and by both.
TEST(TechniquesTest, V7LightAlongLinesAndAllTogether) {
  ExpectAgreement("all against lines", 1.5 * Bias(),
                  TilePairs(FoggyScenes(), kBoth, {.direct_light = DirectLight::kByLines}, 600));
}
TEST(TechniquesTest, V7LightAtTheEndOfFlightsAndAllTogether) {
  ExpectAgreement("all against flights", BiasOfNoisyPair(),
                  TilePairs(FoggyScenes(), kBoth, {.direct_light = DirectLight::kBySampling}, 700));
}

TEST(TechniquesTest, LightsByTheirImportanceAndEvenly) {
  ExpectAgreement("importance against even choice", Bias(),
                  TilePairs(AllScenes(kColored), kBoth, {.choose_lights_evenly = true}, 400));
}

TEST(TechniquesTest, SpectraAndRgbOfGreyScenes) {
  ExpectAgreement("RGB against spectra", Bias(),
                  TilePairs(AllScenes(kGrey), kBoth, {.color = ColorTransport::kSpectral}, 500));
}

// --- The tests' own tools ------------------------------------------------------------------------

TEST(AgreementTest, StudentCdfHasTabulatedValues) {
  EXPECT_NEAR(testing::StudentCdf(0, 7), 0.5, 1e-14);
  EXPECT_NEAR(testing::StudentCdf(1, 1), 0.75, 1e-12);  // Cauchy: 1/2 + atan(t) / pi.
  EXPECT_NEAR(testing::StudentCdf(-1, 2), 0.5 - 0.5 / std::sqrt(3.0), 1e-12);
  EXPECT_NEAR(testing::StudentCdf(1.812461122811676, 10), 0.95, 1e-9);
  EXPECT_NEAR(testing::StudentCdf(-2.749995653567231, 30), 0.005, 1e-9);
}

TEST(AgreementTest, UniformityHasTheValuesOfTheDistribution) {
  std::vector<double> even, low;
  for (int i = 0; i < 1000; ++i) {
    even.push_back((i + 0.5) / 1000);
    low.push_back(even.back() * 0.95);
  }
  EXPECT_NEAR(testing::UniformityP(even), 1, 1e-12);
  // A distance of 0.05: Kolmogorov's 2 sum (-1)^(j-1) exp(-2 j^2 (sqrt(n) D)^2) with Stephens' n.
  EXPECT_NEAR(testing::UniformityP(low), 0.0132, 0.0015);
}

// Draws of one distribution give uniform p-values; the rate of false alarms is the significance.
TEST(AgreementTest, WithoutABiasTheAlarmRateIsTheSignificance) {
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
