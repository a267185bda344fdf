// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows L23 to L27 and G2 of the catalogue of hard cases: fields that a training learned from too
// much light, too little, and none.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "tests/support/guided_scenes.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "worker/render/guiding_training.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

constexpr float kRho = 0.5f;
constexpr int32_t kPixels = 8;
constexpr Vec3f kUp{0, 1, 0};

CompiledScenePtr CompileWith(const TestScene& t, TechniqueSet techniques, uint64_t samples,
                             int32_t depth, const CompileTechniques& training = kSmallTraining) {
  FrameSettings settings = SquareSettings(kPixels, samples, depth);
  settings.techniques = techniques;
  return Compile(t.scene, settings, training);
}
CompiledScenePtr CompileGuided(const TestScene& t, uint64_t samples, int32_t depth,
                               const CompileTechniques& training = kSmallTraining) {
  return CompileWith(t, TechniqueSet::kCameraGuided, samples, depth, training);
}
FilmTile FilmByCamera(const TestScene& t, uint64_t samples, int32_t depth) {
  return RenderAll(*CompileWith(t, TechniqueSet::kCamera, samples, depth));
}

// The directions learned at a place of the scene that faces n; null where there are none.
const GuidingRegion* LearnedAt(const CompiledScene& scene, Vec3d p, Vec3f n) {
  return scene.guiding->fields()->directions.RegionAt(
      {ToFloat(p - scene.geometry.render_origin_world), n});
}

// A camera at the height that sees a square of the floor around x = z = 0 without perspective.
TestScene Above(double height, double half) {
  TestScene t({0, height, 0}, {0, 0, 0}, 30, {0, 0, 1});
  t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
  t.scene.camera.screen_window[0] = t.scene.camera.screen_window[2] = -half;
  t.scene.camera.screen_window[1] = t.scene.camera.screen_window[3] = half;
  return t;
}
int32_t Mirror(TestScene* t) {
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(1);
  return t->AddMaterial(mirror);
}

// Expected by the catalogue: rho L R^2 cos / d^2 for a spherical lamp that a floor sees in a mirror
// alone, at distance d of its image. One scattering in 1600 finds it, in a training as in an image,
// and it is 2^60 times as bright as the sky that the others find.
TEST(GuidingStability, L23LightThatFewPathsFind) {
  constexpr float kSky = 1e-6f, kLamp = 0x1p60f * kSky, kRadius = 0.1f;
  TestScene t = Above(1.5, 0.01);
  t.ConstantEnvironment(Rgb::Gray(kSky));
  t.AddShape(MeshShape{t.Quad({-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1})},
             t.Diffuse(Rgb::Gray(kRho)));
  t.AddShape(MeshShape{t.Quad({0.8f, 2, -1}, {2.2f, 2, -1}, {2.2f, 2, 1}, {0.8f, 2, 1})},
             Mirror(&t));
  t.AddShape(SphereShape{kRadius, -kRadius, kRadius, 360}, t.Diffuse({}),
             TranslateMatrix({2, 1, 0}))
      .area_light = t.AreaLight(Rgb::Gray(kLamp));
  // A black wall between floor and lamp.
  t.AddShape(MeshShape{t.Quad({1, 0, -2}, {1, 1, -2}, {1, 1, 2}, {1, 0, 2})}, t.Diffuse({}));
  const CompiledScenePtr scene =
      CompileGuided(t, DrawCount(16384, 65536), 2, {.training_paths_first = 4096});
  const TileMean guided = MeanOf(RenderAll(*scene));
  const TileMean camera = MeanOf(FilmByCamera(t, DrawCount(16384, 65536), 2));
  const GuidingRegion* region = LearnedAt(*scene, {0, 0, 0}, kUp);
  ASSERT_NE(region, nullptr);
  EXPECT_TRUE(std::isfinite(region->ScatteredLight()));
  const double d_squared = 13, cosine = 3 / std::sqrt(d_squared);
  const double seen = static_cast<double>(kRadius * kRadius) * cosine / d_squared;
  const double expected = static_cast<double>(kRho * kLamp) * seen;
  // Camera paths alone find it too rarely.
  EXPECT_LT(guided.standard_error.r, 0.05 * expected);
  EXPECT_LT(guided.standard_error.r, 0.5f * camera.standard_error.r);
  EXPECT_EQ(guided.non_finite, 0u);
  ExpectHardCase({.row = "L23",
                  .figure = "radiance of a floor that sees a lamp in a mirror",
                  .expected = expected,
                  .measured = guided.mean.r,
                  .standard_error = guided.standard_error.r,
                  .tolerance = 1e-4 * expected,
                  .naive = kRho * static_cast<float>(seen) * (0x1p20f * kSky),
                  .naive_by = "samples clamped at 2^20 times the sky"});
}

// Expected by the catalogue: 0 in a closed box without a lamp beside a lit room, and the light of
// camera paths in the room. Nothing is known about directions in the box.
TEST(GuidingStability, L24RegionsThatSawNoLight) {
  TestScene t = Above(0.9, 0.4);
  const auto add_room = [&](float x0, float x1) {
    t.AddShape(MeshShape{t.Box({x0, 0, -1}, {x1, 1, 1})}, t.Diffuse(Rgb::Gray(0.7f)));
  };
  add_room(-1, -0.01f);
  add_room(0.01f, 1);
  // Not above the part of the floor that the camera sees.
  t.AddShape(MeshShape{t.Quad({-0.7f, 0.9f, 0.5f}, {-0.2f, 0.9f, 0.5f}, {-0.2f, 0.9f, 0.8f},
                              {-0.7f, 0.9f, 0.8f})},
             t.Diffuse({}))
      .area_light = t.AreaLight(Rgb::Gray(5));
  const uint64_t samples = DrawCount(512, 8192);
  const CompiledScenePtr scene = CompileGuided(t, samples, 5);
  const FilmTile guided = RenderAll(*scene), camera = FilmByCamera(t, samples, 5);
  const TileMean of_guided = MeanOf(guided), of_camera = MeanOf(camera);
  EXPECT_EQ(of_guided.non_finite, 0u);
  std::printf(
      "box: %g +- %g by camera paths, %g +- %g guided\n", static_cast<double>(of_camera.mean.r),
      static_cast<double>(of_camera.standard_error.r), static_cast<double>(of_guided.mean.r),
      static_cast<double>(of_guided.standard_error.r));
  double in_box = 0;
  size_t lit = 0;
  for (size_t i = 0; i < guided.plane_size(); ++i) {
    const float value = guided.channel(FilmChannel::kRedHi)[i];
    EXPECT_EQ(value > 0, camera.channel(FilmChannel::kRedHi)[i] > 0);
    if (value > 0) ++lit;
    if (camera.channel(FilmChannel::kRedHi)[i] == 0) in_box += static_cast<double>(value);
  }
  EXPECT_EQ(lit, guided.plane_size() / 2);
  EXPECT_NE(LearnedAt(*scene, {-0.9, 0.5, 0}, kUp), nullptr);
  EXPECT_EQ(LearnedAt(*scene, {0.9, 0.5, 0}, kUp), nullptr);
  ExpectHardCase({.row = "L24",
                  .figure = "light in a closed box",
                  .expected = 0,
                  .measured = in_box,
                  .naive = std::nanf(""),
                  .naive_by = "shares of a sum that is 0"});
  const double error = std::hypot(of_guided.standard_error.r, of_camera.standard_error.r);
  EXPECT_LT(error, 0.01 * static_cast<double>(of_camera.mean.r));
  ExpectHardCase({.row = "L24",
                  .figure = "light of the room beside it, over that of camera paths",
                  .expected = 1,
                  .measured = of_guided.mean.r / of_camera.mean.r,
                  .standard_error = error / static_cast<double>(of_camera.mean.r)});
}

double RedOf(const CompiledScene& scene) {
  const FilmTile film = RenderAll(scene);
  double sum = 0;
  for (size_t i = 0; i < film.plane_size(); ++i) {
    sum += static_cast<double>(film.channel(FilmChannel::kRedHi)[i]) +
           static_cast<double>(film.channel(FilmChannel::kRedLo)[i]);
  }
  return sum;
}

// Expected by the catalogue: a lamp that is 2^20 times as bright or dim gives that multiple of the
// image, to the bit: the unit in which a training counts light follows the light.
TEST(GuidingStability, L25LightOfAnyMagnitude) {
  const auto image = [](float scale) {
    TestScene t = SlitRoom({0}, 0.5f);
    Rgb& radiance = t.scene.area_lights[0].radiance.rgb;
    radiance = radiance * scale;
    return RedOf(*CompileGuided(t, 32, 5));
  };
  const double unit = image(1);
  EXPECT_GT(unit, 0);
  for (const double scale : {0x1p-20, 0x1p20}) {
    ExpectHardCase({.row = "L25",
                    .figure = "image under a lamp of " + InWords(scale) + " over the multiple",
                    .expected = 1,
                    .measured = image(static_cast<float>(scale)) / (scale * unit),
                    .naive = std::min(1.0, std::floor(scale)),
                    .naive_by = "whole numbers of a fixed unit"});
  }
}

// Expected by the catalogue: a room that is 2^20 times as large or small has the same bits.
TEST(GuidingStability, G2GuidedFramesAtEveryScale) {
  const double unit = RedOf(*CompileGuided(LitRoom(1), 32, 4));
  EXPECT_GT(unit, 0);
  for (const double scale : {0x1p-20, 0x1p20}) {
    EXPECT_EQ(RedOf(*CompileGuided(LitRoom(scale), 32, 4)), unit) << scale;
  }
}

// Expected by the catalogue: the image of camera paths. To the bit where a lamp without size lights
// a floor, whose scattering finds nothing; in the mean in a room of mirrors, whose directions
// cannot be guided, but where it is known what paths contribute.
TEST(GuidingStability, L26ScatteringThatCannotBeGuided) {
  TestScene floor = Above(2, 0.5);
  PointLight lamp;
  lamp.intensity.rgb = Rgb::Gray(1);
  lamp.from = {0.2f, 1, 0};
  floor.scene.lights.push_back({lamp, {}, {}, {}});
  floor.AddShape(MeshShape{floor.Quad({-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1})},
                 floor.Diffuse(Rgb::Gray(kRho)));
  const CompiledScenePtr of_floor = CompileGuided(floor, 32, 6);
  const FilmTile lit = RenderAll(*of_floor);
  EXPECT_GT(MeanOf(lit).mean.r, 0);
  ExpectHardCase({.row = "L26",
                  .figure = "floors that differ from that of camera paths",
                  .expected = 0,
                  .measured = lit == FilmByCamera(floor, 32, 6) ? 0 : 1,
                  .naive = std::nanf(""),
                  .naive_by = "shares of a sum that is 0"});

  TestScene mirrors({0.1, 0.2, -0.7}, {0, 0, 1}, 70);
  mirrors.AddShape(MeshShape{mirrors.Box({-1, -1, -1}, {1, 1, 1})}, Mirror(&mirrors));
  mirrors.AddShape(SphereShape{0.3f, -0.3f, 0.3f, 360}, mirrors.AddMaterial(DielectricMaterial{}),
                   TranslateMatrix({0.3, -0.5, 0.4}));
  mirrors
      .AddShape(SphereShape{0.2f, -0.2f, 0.2f, 360}, mirrors.Diffuse({}),
                TranslateMatrix({-0.5, 0.4, 0.3}))
      .area_light = mirrors.AreaLight(Rgb::Gray(2));
  const uint64_t samples = DrawCount(512, 8192);
  const CompiledScenePtr of_mirrors = CompileGuided(mirrors, samples, 6);
  const TileMean guided = MeanOf(RenderAll(*of_mirrors)),
                 camera = MeanOf(FilmByCamera(mirrors, samples, 6));
  for (const CompiledScenePtr* scene : {&of_floor, &of_mirrors}) {
    EXPECT_EQ(LearnedAt(**scene, {0, 0, 0}, kUp), nullptr);
  }
  std::printf("mirrors: %g +- %g by camera paths, %g +- %g guided\n",
              static_cast<double>(camera.mean.r), static_cast<double>(camera.standard_error.r),
              static_cast<double>(guided.mean.r), static_cast<double>(guided.standard_error.r));
  EXPECT_EQ(guided.non_finite, 0u);
  const double error = std::hypot(guided.standard_error.r, camera.standard_error.r) /
                       static_cast<double>(camera.mean.r);
  EXPECT_LT(error, 0.01);
  ExpectHardCase({.row = "L26",
                  .figure = "light in a room of mirrors over that of camera paths",
                  .expected = 1,
                  .measured = guided.mean.r / camera.mean.r,
                  .standard_error = error,
                  .tolerance = 1e-5});
}

// Expected by the catalogue: the light of a sky alone, 0 without anything, and 0 in a room whose
// lamp is black. A scene without shapes has no extent.
TEST(GuidingStability, L27NothingToLearn) {
  const TestScene empty({0, 0, 0}, {0, 0, 1}, 60);
  TestScene sky = empty, black = LitRoom(1);
  sky.ConstantEnvironment(Rgb::Gray(0.75f));
  black.scene.area_lights[0].radiance.rgb = {};
  const struct {
    const TestScene* scene;
    double expected;
    const char* name;
  } cases[] = {{&empty, 0, "nothing"}, {&sky, 0.75, "a sky"}, {&black, 0, "a black lamp"}};
  for (const auto& c : cases) {
    for (const TechniqueSet techniques :
         {TechniqueSet::kCameraGuided, TechniqueSet::kCameraAndLightGuided}) {
      const CompiledScenePtr scene = CompileWith(*c.scene, techniques, 16, 5);
      const TileMean mean = MeanOf(RenderAll(*scene));
      EXPECT_EQ(mean.non_finite, 0u);
      const GuidingField& field = scene->guiding->fields()->directions;
      EXPECT_EQ(field.RegionAt({0, 0, 0}), nullptr);
      EXPECT_EQ(field.RegionAt({1e30f, -1e30f, 0}), nullptr);
      EXPECT_TRUE(GuidingField::Decode(field.Encode()).ok());
      ExpectHardCase({.row = "L27",
                      .figure = std::string("radiance of ") + c.name + ", " + techniques.Name(),
                      .expected = c.expected,
                      .measured = mean.mean.r,
                      .naive = std::nanf(""),
                      .naive_by = "positions relative to a box without extent"});
    }
  }
}

}  // namespace
}  // namespace sheaf::render
