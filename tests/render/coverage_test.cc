// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whether intervals of 95 % hold the true mean in 95 of 100 pictures: of frames and of their tiles,
// over many seeds, on small scenes that differ in how light comes to the camera. The truth is a
// picture of another seed with thousands of times the samples, whose own standard error must be
// small beside theirs. SHEAF_LONG_TESTS=1 takes the seeds that tell 95 % from 93.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "common/film/mean_interval.h"
#include "tests/support/long_tests.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr int32_t kSizePx = 16, kTilePx = 8;
constexpr std::array<double, 3> kLuminance{0.2126, 0.7152, 0.0722};

struct CoverageCase {
  std::string name;
  std::function<TestScene()> make;
  uint64_t samples = 64;
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
             t.Diffuse(Rgb::Grey(0.6f)));
  t.AddShape(SphereShape{0.8f, -0.8f, 0.8f, 360}, t.Diffuse({0.8f, 0.3f, 0.2f}),
             TranslateMatrix({0, 0.8, 0}));
  return t;
}
TestScene SmallLamp() {
  TestScene t({0, 2, -4}, {0, 0, 0}, 40);
  t.AddShape(MeshShape{t.Quad({-9, 0, -9}, {-9, 0, 9}, {9, 0, 9}, {9, 0, -9})},
             t.Diffuse(Rgb::Grey(0.5f)));
  t.AddShape(SphereShape{0.1f, -0.1f, 0.1f, 360}, t.Diffuse({}), TranslateMatrix({0.3, 0.5, 0}))
      .area_light = t.AreaLight(Rgb::Grey(20));
  t.AddShape(MeshShape{t.Box({-0.6f, 0, -0.2f}, {-0.2f, 0.7f, 0.2f})}, t.Diffuse(Rgb::Grey(0.7f)));
  return t;
}
TestScene FogInTheRoom() {
  TestScene t = LitRoom(1);
  MediumDescription fog;
  fog.sigma_s.rgb = Rgb::Grey(1.5f);
  t.scene.media.push_back(fog);
  t.AddShape(MeshShape{t.Box({-0.6f, -0.6f, 0}, {0.6f, 0.6f, 0.8f})},
             t.AddMaterial(InterfaceMaterial{}))
      .media.inside = 0;
  return t;
}

class CoverageTest : public testing::TestWithParam<CoverageCase> {};

struct Count {
  int reliable = 0, held = 0;
  void Add(const MeanInterval& interval, const MeanInterval& truth) {
    if (!interval.is_reliable) return;
    EXPECT_LT(truth.standard_error, 0.2 * interval.standard_error);
    ++reliable;
    if (std::fabs(interval.mean - truth.mean) <= interval.half_width) ++held;
  }
  double Share() const { return held / static_cast<double>(reliable); }
  // 2 % beside 95, and three standard deviations of the count.
  void Expect() const {
    ASSERT_GT(reliable, 0);
    EXPECT_NEAR(Share(), 0.95, 0.02 + 3 * std::sqrt(0.95 * 0.05 / reliable));
  }
};

TEST_P(CoverageTest, IntervalsHoldTheTruthAsOftenAsTheySay) {
  const SceneDescription scene = GetParam().make().scene;
  FrameSettings settings = SquareSettings(kSizePx, GetParam().samples, 5);
  std::vector<PixelRect> regions = CutTiles(settings.window, kTilePx);
  regions.push_back(settings.window);
  settings.samples *= static_cast<uint64_t>(DrawCount(128, 2048));
  settings.seed = 1'000'003;
  const FilmTile long_picture = RenderAll(*Compile(scene, settings));
  std::vector<MeanInterval> truths;
  for (const PixelRect& region : regions) {
    truths.push_back(MeanIntervalOf(long_picture, region, kLuminance));
  }
  settings.samples = GetParam().samples;
  const auto run_count = static_cast<uint64_t>(DrawCount(50, 500));
  Count tiles, frames;
  for (settings.seed = 1; settings.seed <= run_count; ++settings.seed) {
    const FilmTile picture = RenderAll(*Compile(scene, settings));
    for (size_t i = 0; i < regions.size(); ++i) {
      Count& count = i + 1 < regions.size() ? tiles : frames;
      count.Add(MeanIntervalOf(picture, regions[i], kLuminance), truths[i]);
    }
  }
  std::printf("%-6s tiles: %5.1f %% of %d reliable of %zu; frames: %5.1f %% of %d of %zu\n",
              GetParam().name.c_str(), 100 * tiles.Share(), tiles.reliable,
              (regions.size() - 1) * run_count, 100 * frames.Share(), frames.reliable,
              size_t{run_count});
  tiles.Expect();
  frames.Expect();
}

std::string NameOf(const testing::TestParamInfo<CoverageCase>& tested) { return tested.param.name; }

INSTANTIATE_TEST_SUITE_P(Scenes, CoverageTest,
                         testing::Values(CoverageCase{"room", [] { return LitRoom(1); }},
                                         CoverageCase{"sky", UnderTheSky},
                                         CoverageCase{"lamp", SmallLamp},
                                         CoverageCase{"metal", MetalInTheRoom},
                                         CoverageCase{"fog", FogInTheRoom}),
                         NameOf);

}  // namespace
}  // namespace sheaf::render
