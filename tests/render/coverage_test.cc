// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests whether 95 % confidence intervals contain the true mean in 95 of 100 images: for frames and
// for their tiles, over many seeds, on small scenes with different kinds of light transport. The
// true mean is that of an image with another seed and thousands of times the samples, whose own
// standard error must be small in comparison. SHEAF_LONG_TESTS=1 uses enough seeds to distinguish
// 95 % from 93 %.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "common/film/error/mean_interval.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/long_tests.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr int32_t kSizePx = 16, kTilePx = 8;
constexpr std::array<double, 3> kLuminance{0.2126, 0.7152, 0.0722};

struct CoverageCase {
  std::string name;
  std::function<TestScene()> make;
  uint64_t samples = 64;
  TechniqueSet techniques = TechniqueSet::kCamera;
  CompileTechniques compile = {};
};
void PrintTo(const CoverageCase& c, std::ostream* out) { *out << c.name; }

TestScene MetalInTheRoom() {
  TestScene t = LitRoom(1);
  ConductorMaterial metal;
  metal.roughness = {{0.3f, kNone}, {0.3f, kNone}, false};
  metal.has_reflectance = true;
  metal.reflectance.value.rgb = {0.9f, 0.7f, 0.4f};
  t.AddShape(SphereShape{0.2f, -0.2f, 0.2f, 360}, t.AddMaterial(metal),
             TranslateMatrix({-0.4, 0.1, 0.3}));
  return t;
}
TestScene UnderTheSky() {
  TestScene t({0, 1, -4}, {0, 0.4, 0}, 45);
  t.ConstantEnvironment({0.4f, 0.6f, 1});
  t.AddShape(MeshShape{t.Quad({-9, 0, -9}, {-9, 0, 9}, {9, 0, 9}, {9, 0, -9})},
             t.Diffuse(Rgb::Gray(0.6f)));
  t.AddShape(SphereShape{0.8f, -0.8f, 0.8f, 360}, t.Diffuse({0.8f, 0.3f, 0.2f}),
             TranslateMatrix({0, 0.8, 0}));
  return t;
}
TestScene SmallLight() {
  TestScene t({0, 2, -4}, {0, 0, 0}, 40);
  t.AddShape(MeshShape{t.Quad({-9, 0, -9}, {-9, 0, 9}, {9, 0, 9}, {9, 0, -9})},
             t.Diffuse(Rgb::Gray(0.5f)));
  t.AddShape(SphereShape{0.1f, -0.1f, 0.1f, 360}, t.Diffuse({}), TranslateMatrix({0.3, 0.5, 0}))
      .area_light = t.AreaLight(Rgb::Gray(20));
  t.AddShape(MeshShape{t.Box({-0.6f, 0, -0.2f}, {-0.2f, 0.7f, 0.2f})}, t.Diffuse(Rgb::Gray(0.7f)));
  return t;
}
TestScene FogInTheRoom() {
  TestScene t = LitRoom(1);
  MediumDescription fog;
  fog.sigma_s.rgb = Rgb::Gray(1.5f);
  t.scene.media.push_back(fog);
  t.AddShape(MeshShape{t.Box({-0.6f, -0.6f, 0}, {0.6f, 0.6f, 0.8f})},
             t.AddMaterial(InterfaceMaterial{}))
      .media.inside = 0;
  return t;
}

TestScene BlurredRoom() {
  TestScene t = LitRoom(1);
  t.scene.camera.lens_radius = 0.05f;
  t.scene.camera.focal_distance = 1;
  return t;
}

// The interval of the frame's light, that of light paths included: errors of independent means add
// in quadrature, as where images are developed.
MeanInterval IntervalOf(const BothFilms& films, const PixelRect& region) {
  const MeanInterval camera = MeanIntervalOf(films.camera, region, kLuminance);
  if (!films.light) return camera;
  const MeanInterval light = MeanIntervalOf(*films.light, region, kLuminance);
  MeanInterval sum;
  sum.mean = camera.mean + light.mean;
  sum.standard_error = std::hypot(camera.standard_error, light.standard_error);
  sum.half_width = std::hypot(camera.half_width, light.half_width);
  sum.is_reliable = IsSumReliable(camera, light);
  return sum;
}

class CoverageTest : public ::testing::TestWithParam<CoverageCase> {};

struct Count {
  int reliable = 0, held = 0;
  void Add(const MeanInterval& interval, const MeanInterval& truth) {
    if (!interval.is_reliable) return;
    EXPECT_LT(truth.standard_error, 0.2 * interval.standard_error);
    ++reliable;
    if (std::fabs(interval.mean - truth.mean) <= interval.half_width) ++held;
  }
  double Fraction() const { return held / static_cast<double>(reliable); }
  // Tolerance: 2 % around 95 %, plus three standard deviations of the count.
  void Expect() const {
    ASSERT_GT(reliable, 0);
    EXPECT_NEAR(Fraction(), 0.95, 0.02 + 3 * std::sqrt(0.95 * 0.05 / reliable));
  }
};

TEST_P(CoverageTest, IntervalsHaveTheirStatedCoverage) {
  const SceneDescription scene = GetParam().make().scene;
  FrameSettings settings = SquareSettings(kSizePx, GetParam().samples, 5);
  settings.techniques = GetParam().techniques;
  std::vector<PixelRect> regions = CutTiles(settings.window, kTilePx);
  regions.push_back(settings.window);
  settings.samples *= static_cast<uint64_t>(DrawCount(128, 2048));
  settings.seed = 1'000'003;
  const BothFilms long_image = RenderBothFilms(*Compile(scene, settings, GetParam().compile));
  std::vector<MeanInterval> truths;
  for (const PixelRect& region : regions) truths.push_back(IntervalOf(long_image, region));
  settings.samples = GetParam().samples;
  const auto run_count = static_cast<uint64_t>(DrawCount(50, 500));
  Count tiles, frames;
  for (settings.seed = 1; settings.seed <= run_count; ++settings.seed) {
    const BothFilms image = RenderBothFilms(*Compile(scene, settings, GetParam().compile));
    for (size_t i = 0; i < regions.size(); ++i) {
      Count& count = i + 1 < regions.size() ? tiles : frames;
      count.Add(IntervalOf(image, regions[i]), truths[i]);
    }
  }
  std::printf("%-6s tiles: %5.1f %% of %d reliable of %zu; frames: %5.1f %% of %d of %zu\n",
              GetParam().name.c_str(), 100 * tiles.Fraction(), tiles.reliable,
              (regions.size() - 1) * run_count, 100 * frames.Fraction(), frames.reliable,
              size_t{run_count});
  tiles.Expect();
  frames.Expect();
}

// Scenes whose samples have infinite, or practically infinite, variance: the observed samples do
// not represent rare ones, and the interval of the frame or of a tile must be flagged as
// unreliable.
struct HeavyCase {
  std::string name;
  std::function<TestScene()> make;
  CompileTechniques techniques;
};
void PrintTo(const HeavyCase& c, std::ostream* out) { *out << c.name; }

// In-scattered light at distance r from a point light is proportional to 1 / r^2. The integral of
// its square over a volume diverges as that of 1 / r^2. Equiangular sampling would avoid this
// (path_tracer_lines.h).
TestScene LightInCloud(float density) {
  TestScene t({0, 0, -4}, {0, 0, 0}, 40);
  PointLight light;
  light.intensity.rgb = Rgb::Gray(1);
  t.scene.lights.push_back({light, {}, {}, {}});
  MediumDescription cloud;
  cloud.sigma_s.rgb = Rgb::Gray(1);
  UniformGridMedium grid;
  grid.box = {{3, 3, 3}, {-1, -1, -1}, {1, 1, 1}};
  for (int i = 0; i < 27; ++i) grid.density.push_back(density * static_cast<float>(1 + i % 3));
  cloud.kind = std::move(grid);
  t.scene.media.push_back(std::move(cloud));
  t.AddShape(MeshShape{t.Box({-1, -1, -1}, {1, 1, 1})}, t.AddMaterial(InterfaceMaterial{}))
      .media.inside = 0;
  return t;
}
// A point light at height h above a floor: the integral of its squared irradiance over the floor
// grows as 1 / h^2. The camera sees light reflected by other walls, not the lit spot itself.
TestScene LightOnFloor() {
  TestScene t = LitRoom(1);
  t.scene.area_lights[0].radiance.rgb = Rgb::Gray(0.01f);
  PointLight light;
  light.intensity.rgb = Rgb::Gray(1);
  light.from = {-0.6, -1 + 1e-4, -0.9};
  t.scene.lights.push_back({light, {}, {}, {}});
  return t;
}

class HeavyTailTest : public ::testing::TestWithParam<HeavyCase> {};

TEST_P(HeavyTailTest, HeavyTailsAreReportedUnreliable) {
  const SceneDescription scene = GetParam().make().scene;
  FrameSettings settings = SquareSettings(kSizePx, 64, 5);
  const auto run_count = static_cast<uint64_t>(DrawCount(30, 500));
  uint64_t flagged = 0;
  for (settings.seed = 1; settings.seed <= run_count; ++settings.seed) {
    TableFileSource files({});
    const absl::StatusOr<CompiledScenePtr> compiled =
        CompileScene(scene, settings, files, {.build_threads = 1}, GetParam().techniques);
    ASSERT_TRUE(compiled.ok()) << compiled.status();
    const FilmTile image = RenderAll(**compiled);
    bool is_reliable = MeanIntervalOf(image, settings.window, kLuminance).is_reliable;
    for (const PixelRect& tile : CutTiles(settings.window, kTilePx)) {
      is_reliable = is_reliable && MeanIntervalOf(image, tile, kLuminance).is_reliable;
    }
    if (!is_reliable) ++flagged;
  }
  std::printf("%-12s %zu of %zu images called unreliable\n", GetParam().name.c_str(),
              size_t{flagged}, size_t{run_count});
  EXPECT_EQ(flagged, run_count);
}

std::string NameOfHeavy(const ::testing::TestParamInfo<HeavyCase>& tested) {
  return tested.param.name;
}
constexpr CompileTechniques kDistanceSamplingOnly{.equiangular_mode = EquiangularMode::kNever};
INSTANTIATE_TEST_SUITE_P(
    Scenes, HeavyTailTest,
    ::testing::Values(HeavyCase{"thin_cloud", [] { return LightInCloud(0.2f); },
                                kDistanceSamplingOnly},
                      HeavyCase{"cloud", [] { return LightInCloud(1); }, kDistanceSamplingOnly},
                      HeavyCase{"floor", LightOnFloor, {}}),
    NameOfHeavy);

std::string NameOf(const ::testing::TestParamInfo<CoverageCase>& tested) {
  return tested.param.name;
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, CoverageTest,
    ::testing::Values(CoverageCase{"room", [] { return LitRoom(1); }},
                      CoverageCase{"sky", UnderTheSky}, CoverageCase{"lamp", SmallLight},
                      CoverageCase{"metal", MetalInTheRoom}, CoverageCase{"fog", FogInTheRoom},
                      CoverageCase{"blur", BlurredRoom},
                      CoverageCase{"glossy", [] { return Glossy(Tint{1}); }},
                      CoverageCase{"outdoor", [] { return Outdoor(Tint{1}); }},
                      CoverageCase{"lamps", [] { return ManyLights(Tint{1}); }},
                      CoverageCase{"haze", [] { return Hazy(Tint{1}); }}),
    NameOf);

constexpr TechniqueSet kBoth = TechniqueSet::kCameraAndLight;
INSTANTIATE_TEST_SUITE_P(
    LightPaths, CoverageTest,
    ::testing::Values(CoverageCase{"room", [] { return LitRoom(1); }, 64, kBoth},
                      CoverageCase{"sky", UnderTheSky, 64, kBoth},
                      CoverageCase{"metal", MetalInTheRoom, 64, kBoth},
                      CoverageCase{"blur", BlurredRoom, 64, kBoth},
                      CoverageCase{"glossy", [] { return Glossy(Tint{1}); }, 64, kBoth}),
    NameOf);

// Each image is guided by a field of its own: an interval is about the samples beyond it.
CoverageCase Guided(std::string name, std::function<TestScene()> make) {
  return {std::move(name),
          std::move(make),
          64,
          TechniqueSet::kCameraGuided,
          {.training_paths_first = 512}};
}
INSTANTIATE_TEST_SUITE_P(Guided, CoverageTest,
                         ::testing::Values(Guided("room", [] { return LitRoom(1); }),
                                           Guided("sky", UnderTheSky),
                                           Guided("metal", MetalInTheRoom),
                                           Guided("blur", BlurredRoom),
                                           Guided("outdoor", [] { return Outdoor(Tint{1}); })),
                         NameOf);

}  // namespace
}  // namespace sheaf::render
