// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows L43 and L53 to L57 of the catalogue of hard cases, and row G2: light paths that are merged
// with camera paths behind smooth glass.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "common/film/film.h"
#include "tests/support/fog_scene.h"
#include "tests/support/hard_case.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/test_scene.h"
#include "worker/render/gather/merging.h"

namespace sheaf::render {
namespace {

const TechniqueSet kMerged = TechniqueSet::kCameraAndLight.With(Technique::kMerging);
constexpr float kRho = 0.5f;
constexpr int32_t kPixels = 8;
// The refractions of a pane, and the floor.
constexpr int32_t kDepthBehindPane = 3;
// The same with the refractions of the light.
constexpr int32_t kDepthBothWays = 5;
// The share of light that passes a pane straight, without reflections between its sides.
constexpr double kPane = 0.96 * 0.96;

BothFilms Render(const TestScene& t, TechniqueSet techniques, uint64_t samples, int32_t depth,
                 const FilmOutputs& outputs = {}) {
  FrameSettings settings = SquareSettings(kPixels, samples, depth);
  settings.techniques = techniques;
  settings.outputs = outputs;
  return RenderBothFilms(*Compile(t.scene, settings));
}
ComponentMean RedOf(const TestScene& t, TechniqueSet techniques, uint64_t samples, int32_t depth) {
  return MeanOverPixels(Render(t, techniques, samples, depth), 0);
}

FrameImage Developed(const FilmTile& film) {
  FrameImage image = MakeFrameImage(film.rect(), kPixels, kPixels, film.outputs());
  DevelopTile(film, &image);
  return image;
}

// A camera that sees a square of a floor y = 0 without perspective, through a pane of glass.
FogScene AbovePane() {
  FogScene t({0, 2, 0}, {0, 0, 0}, 30, {0, 0, 1});
  t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
  t.scene.camera.screen_window[0] = t.scene.camera.screen_window[2] = -0.5;
  t.scene.camera.screen_window[1] = t.scene.camera.screen_window[3] = 0.5;
  t.AddShape(MeshShape{t.Box({-2, 0.5f, -2}, {2, 0.6f, 2})}, t.AddMaterial(DielectricMaterial{}));
  return t;
}
int32_t Floor(TestScene* t, float half, float y = 0) {
  return t->Quad({-half, y, -half}, {-half, y, half}, {half, y, half}, {half, y, -half});
}
FogScene FloorBehindPane() {
  FogScene t = AbovePane();
  t.AddShape(MeshShape{Floor(&t, 1)}, t.Diffuse(Rgb::Gray(kRho)));
  return t;
}
// The irradiance on a surface that faces `from`.
LightDescription& AddSun(TestScene* t, Vec3d from = {0, 1, 0}, float irradiance = 1) {
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(irradiance);
  sun.from = from;
  sun.to = {0, 0, 0};
  t->scene.lights.push_back({sun, {}, {}, {}});
  return t->scene.lights.back();
}

// Expected by the catalogue: a floor that is lit from below is black from above. So is one above
// another, nearer than the radius within which light paths are merged.
TEST(MergingStability, L43MergingOnTheOtherSide) {
  // Light that passes below the pane is found on the side that the camera sees.
  TestScene lit = FloorBehindPane();
  AddSun(&lit, {1, 0.2, 0});
  EXPECT_GT(RedOf(lit, kMerged, 64, kDepthBehindPane).value, 0.01);
  for (const float gap : {0.0f, 1e-4f}) {
    TestScene t = FloorBehindPane();
    if (gap > 0) {
      t.AddShape(MeshShape{Floor(&t, 1, -gap)}, t.Diffuse(Rgb::Gray(kRho)));
    }
    AddSun(&t, {0, -1, 0});
    ExpectHardCase({.row = "L43",
                    .figure = gap > 0 ? "radiance above a lit floor" : "radiance of the dark side",
                    .expected = 0,
                    .measured = RedOf(t, kMerged, 64, kDepthBehindPane).value,
                    .naive = kRho / std::numbers::pi_v<float>,
                    .naive_by = "all light paths within the radius"});
  }
}

// Expected by the catalogue: radii of merging change with the scene, to the bit.
TEST(MergingStability, G2MergingAtEveryScale) {
  const auto red_at = [](float scale) {
    const auto s = static_cast<double>(scale);
    TestScene t({0, 2 * s, 0}, {0, 0, 0}, 30, {0, 0, 1});
    t.AddShape(MeshShape{Floor(&t, scale)}, t.Diffuse(Rgb::Gray(kRho)));
    t.AddShape(MeshShape{t.Box({-2 * scale, 0.5f * scale, -2 * scale},
                               {2 * scale, 0.625f * scale, 2 * scale})},
               t.AddMaterial(DielectricMaterial{}));
    AddSun(&t);
    return RedOf(t, kMerged, 32, kDepthBothWays).value;
  };
  const double unit = red_at(1);
  EXPECT_GT(unit, 0);
  for (const float scale : {0x1p-20f, 0x1p20f}) EXPECT_EQ(red_at(scale), unit) << scale;
}

// Expected by the catalogue: a floor beside a wall is black if light passes along it and meets the
// wall alone, within the radius of what the camera sees of the floor.
TEST(MergingStability, L53MergingAcrossACorner) {
  TestScene t = FloorBehindPane();
  const float x = 0.45f;
  t.AddShape(MeshShape{t.Quad({x, 0, -1}, {x, 0, 1}, {x, 0.4f, 1}, {x, 0.4f, -1})},
             t.Diffuse(Rgb::Gray(kRho)));
  AddSun(&t, {-1, 0, 0});
  ExpectHardCase({.row = "L53",
                  .figure = "radiance of the floor beside a lit wall",
                  .expected = 0,
                  .measured = RedOf(t, kMerged, 64, kDepthBehindPane).value,
                  .naive = kRho / std::numbers::pi_v<float> / kPixels,
                  .naive_by = "all light paths within the radius, in one column of pixels"});
}

// Expected by the catalogue: surfaces of narrow lobes are left to camera paths, whose image stays
// as it is, but for the rounding of weights of 1; a blur of two footprints would be seen in them.
// Wider lobes are merged.
TEST(MergingStability, L54MergingAtGlossySurfaces) {
  const auto make = [](float alpha) {
    FogScene t = AbovePane();
    ConductorMaterial metal;
    metal.has_reflectance = true;
    metal.reflectance.value.rgb = Rgb::Gray(kRho);
    metal.roughness = {{alpha, kNone}, {alpha, kNone}, false};
    t.AddShape(MeshShape{Floor(&t, 1)}, t.AddMaterial(metal));
    t.AddShape(MeshShape{t.Quad({-1, 0.4f, 0.7f}, {1, 0.4f, 0.7f}, {1, 0.4f, 1.7f},
                                {-1, 0.4f, 1.7f})},
               t.Diffuse({}))
        .area_light = t.AreaLight({5, 5, 5}, true);
    return t;
  };
  const auto of_light_paths = [](const BothFilms& films) {
    double sum = 0;
    for (size_t pixel = 0; pixel < films.light->plane_size(); ++pixel) {
      for (uint32_t r = 0; r < kReplicateCount; ++r) {
        sum += static_cast<double>(films.light->replicate(r, 0)[pixel]);
      }
    }
    return sum;
  };
  const TestScene narrow = make(0.999f * kMergeAlphaMin);
  const BothFilms by_camera = Render(narrow, TechniqueSet::kCamera, 32, kDepthBothWays);
  const BothFilms films = Render(narrow, kMerged, 32, kDepthBothWays);
  EXPECT_GT(MeanOf(by_camera.camera).mean.r, 0);
  EXPECT_EQ(of_light_paths(films), 0);
  double difference = 0;
  for (size_t pixel = 0; pixel < films.camera.plane_size(); ++pixel) {
    for (uint32_t r = 0; r < kReplicateCount; ++r) {
      const double a = by_camera.Mean(r, 0, pixel), b = films.Mean(r, 0, pixel);
      difference = std::max(difference, std::fabs(a - b));
    }
  }
  ExpectHardCase({.row = "L54",
                  .figure = "largest difference from the image of camera paths",
                  .expected = 0,
                  .measured = difference,
                  .tolerance = 0x1p-21});
  EXPECT_GT(of_light_paths(Render(make(2 * kMergeAlphaMin), kMerged, 32, kDepthBothWays)), 0);
}

// Expected by the catalogue: rho / pi (1 - F)^4 exp(-2 tau) for a floor in a medium without a
// surface of its own, between it and the pane. Neither path takes its bounds for a vertex.
TEST(MergingStability, L55MergingBehindHiddenMedia) {
  constexpr double kTau = 0.7;
  FogScene t = FloorBehindPane();
  t.FillBox({-2, 0.1f, -2}, {2, 0.45f, 2},
            t.AddMedium(Rgb::Gray(static_cast<float>(kTau / 0.35)), {}));
  AddSun(&t);
  const ComponentMean red = RedOf(t, kMerged, 256, kDepthBothWays);
  const double without = static_cast<double>(kRho) * std::numbers::inv_pi * kPane * kPane;
  ExpectHardCase({.row = "L55",
                  .figure = "radiance of a floor in fog behind glass",
                  .expected = without * std::exp(-2 * kTau),
                  .measured = red.value,
                  .standard_error = red.standard_error,
                  .tolerance = 1e-4 * without,
                  .naive = static_cast<float>(without),
                  .naive_by = "without media of interfaces"});
}

// Expected by the catalogue: of two suns of 1 and 3, each brings its light to its own layer,
// rho / pi (1 - F)^4 times 1 and 3; and what the camera sees first is what it sees without light
// paths, to the bit.
TEST(MergingStability, L56LayersOfMergedLight) {
  TestScene t = FloorBehindPane();
  AddSun(&t).group = "morning";
  AddSun(&t, {0, 1, 0}, 3).group = "noon";
  FilmOutputs outputs;
  outputs.light_groups = {"morning", "noon"};
  const BothFilms films = Render(t, kMerged, 256, kDepthBothWays, outputs);
  const FrameImage image = Developed(*films.light);
  const double unit = static_cast<double>(kRho) * std::numbers::inv_pi * kPane * kPane;
  const ComponentMean whole = MeanOverPixels(films, 0);
  const double noise = whole.standard_error / whole.value;
  for (const auto& [group, irradiance] : {std::pair{"morning", 1.0}, std::pair{"noon", 3.0}}) {
    const std::vector<float>& plane = *image.Find(std::string(group) + ".R");
    double mean = 0;
    for (const float value : plane) mean += static_cast<double>(value) / kPixels / kPixels;
    ExpectHardCase({.row = "L56",
                    .figure = std::string("light of the group ") + group,
                    .expected = irradiance * unit,
                    .measured = mean,
                    .standard_error = 2 * noise * irradiance * unit,
                    .naive = static_cast<float>(2 * unit),
                    .naive_by = "the same share for each light"});
  }
  const FrameImage merged = Developed(Render(t, kMerged, 16, kDepthBothWays).camera);
  const FrameImage plain = Developed(Render(t, TechniqueSet::kCamera, 16, kDepthBothWays).camera);
  for (const char* channel : {"albedo.R", "normal.Y", "depth.Z", "A"}) {
    EXPECT_GT(plain.Find(channel)->front(), 0) << channel;
    EXPECT_EQ(*merged.Find(channel), *plain.Find(channel)) << channel;
  }
}

// Expected by the catalogue: rho / pi (1 - F)^4 for a floor that rises while the shutter is open.
// Paths of different times meet it at different heights, and miss each other.
TEST(MergingStability, L57MergingOnAMovingFloor) {
  TestScene t = AbovePane();
  t.scene.camera.shutter_close = 1;
  t.AddShape(MeshShape{Floor(&t, 1)}, t.Diffuse(Rgb::Gray(kRho))).world_from_object.end =
      TranslateMatrix({0, 0.45, 0});
  AddSun(&t);
  const ComponentMean red = RedOf(t, kMerged, 256, kDepthBothWays);
  const double expected = static_cast<double>(kRho) * std::numbers::inv_pi * kPane * kPane;
  ExpectHardCase({.row = "L57",
                  .figure = "radiance of a rising floor behind glass",
                  .expected = expected,
                  .measured = red.value,
                  .standard_error = red.standard_error,
                  .tolerance = 1e-4 * expected});
}

}  // namespace
}  // namespace sheaf::render
