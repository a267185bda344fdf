// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rows L17 to L22 of the catalogue of hard cases: light that paths from lights bring to the
// camera.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <variant>

#include "tests/support/hard_case.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/long_tests.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr float kRho = 0.5f;
constexpr int32_t kPixels = 8;

using Mean = ComponentMean;

Mean RedOf(const TestScene& t, TechniqueSet techniques, uint64_t samples, int32_t depth) {
  FrameSettings settings = SquareSettings(kPixels, samples, depth);
  settings.techniques = techniques;
  return MeanOverPixels(RenderBothFilms(*Compile(t.scene, settings)), 0);
}

// A camera above the origin that sees a square of the floor y = 0 without perspective.
TestScene AboveFloor(double height) {
  TestScene t({0, height, 0}, {0, 0, 0}, 30, {0, 0, 1});
  t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
  const double half = 0.5;
  t.scene.camera.screen_window[0] = t.scene.camera.screen_window[2] = -half;
  t.scene.camera.screen_window[1] = t.scene.camera.screen_window[3] = half;
  return t;
}
int32_t Floor(TestScene* t, float half, float y = 0) {
  return t->Quad({-half, y, -half}, {-half, y, half}, {half, y, half}, {half, y, -half});
}
// Irradiance 1 on a floor, from straight above.
void AddSun(TestScene* t) {
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(1);
  sun.from = {0, 1, 0};
  sun.to = {0, 0, 0};
  t->scene.lights.push_back({sun, {}, {}, {}});
}

// Expected by the catalogue: a floor whose shading normals lean by 60 degrees scatters half of the
// light of a sun above it, rho / (2 pi). Flux arrives on the true surface, so that a light path
// that takes the cosine of the shading normal for the true one brings all of it.
TEST(LightPathStability, L17FluxAtShadingNormals) {
  TestScene t = AboveFloor(2);
  AddSun(&t);
  const int32_t mesh = Floor(&t, 1);
  const auto lean = static_cast<float>(std::sqrt(0.75));
  t.scene.meshes[static_cast<size_t>(mesh)].normals.assign(4, {lean, 0.5f, 0});
  t.AddShape(MeshShape{mesh}, t.Diffuse(Rgb::Gray(kRho)));
  const Mean mean = RedOf(t, TechniqueSet::kLight, 256, 1);
  const double expected = 0.5 * static_cast<double>(kRho) / std::numbers::pi;
  EXPECT_LT(mean.standard_error, 0.02 * expected);
  ExpectHardCase({.row = "L17",
                  .figure = "radiance of a floor with leaning normals",
                  .expected = expected,
                  .measured = mean.value,
                  .standard_error = mean.standard_error,
                  .naive = kRho / std::numbers::pi_v<float>,
                  .naive_by = "the cosine of the true normal"});
}

// Expected by the catalogue: a floor in glass under a sun, seen by a camera in the glass, has
// (1 - F) rho / pi, F = 0.04: the flux that is refracted does not depend on eta^2, as radiance
// does.
TEST(LightPathStability, L18RefractionOfFlux) {
  TestScene t = AboveFloor(0.5);
  AddSun(&t);
  t.AddShape(MeshShape{Floor(&t, 1)}, t.Diffuse(Rgb::Gray(kRho)));
  DielectricMaterial glass;
  t.AddShape(MeshShape{t.Box({-2, -1, -2}, {2, 1, 2})}, t.AddMaterial(glass));
  const Mean mean = RedOf(t, TechniqueSet::kLight, 256, 2);
  const double expected = 0.96 * static_cast<double>(kRho) / std::numbers::pi;
  EXPECT_LT(mean.standard_error, 0.03 * expected);
  ExpectHardCase({.row = "L18",
                  .figure = "radiance of a floor in glass",
                  .expected = expected,
                  .measured = mean.value,
                  .standard_error = mean.standard_error,
                  .naive = 0.96f * kRho / std::numbers::pi_v<float> / (1.5f * 1.5f),
                  .naive_by = "the factor 1 / eta^2 of radiance"});
  // No path from the camera finds a sun without size through glass.
  EXPECT_EQ(RedOf(t, TechniqueSet::kCamera, 16, 2).value, 0);
}

// Expected by the catalogue: nothing. Neither kind of path connects a light without size with the
// camera by a mirror alone, and no weight may be 0 / 0.
TEST(LightPathStability, L19LightWithoutSizeInAMirror) {
  TestScene t = AboveFloor(2);
  AddSun(&t);
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(1);
  t.AddShape(MeshShape{Floor(&t, 1)}, t.AddMaterial(mirror));
  for (const TechniqueSet techniques :
       {TechniqueSet::kCamera, TechniqueSet::kCameraAndLight, TechniqueSet::kLight}) {
    EXPECT_EQ(RedOf(t, techniques, 16, 4).value, 0);
  }
  ExpectHardCase({.row = "L19",
                  .figure = "radiance of a sun in a mirror",
                  .expected = 0,
                  .measured = RedOf(t, TechniqueSet::kCameraAndLight, 16, 4).value,
                  .naive = std::nanf(""),
                  .naive_by = "weights that divide by the sum of densities"});
}

// Expected by the catalogue: rho I / (pi d^2) for a floor at distance d from a lamp of intensity I
// that stands in the pinhole itself.
TEST(LightPathStability, L20LampInThePinhole) {
  TestScene t({0, 2, 0}, {0, 0, 0}, 0.5, {0, 0, 1});
  PointLight lamp;
  lamp.intensity.rgb = Rgb::Gray(1);
  lamp.from = {0, 2, 0};
  t.scene.lights.push_back({lamp, {}, {}, {}});
  t.AddShape(MeshShape{Floor(&t, 0.01f)}, t.Diffuse(Rgb::Gray(kRho)));
  const double expected = static_cast<double>(kRho) / (4 * std::numbers::pi);
  const Mean both = RedOf(t, TechniqueSet::kCameraAndLight, 256, 1);
  ExpectHardCase({.row = "L20",
                  .figure = "radiance of a floor under a lamp in the pinhole",
                  .expected = expected,
                  .measured = both.value,
                  .standard_error = both.standard_error,
                  .tolerance = 1e-4 * expected,
                  .naive = INFINITY,
                  .naive_by = "the distance from lamp to lens"});
}

// Expected by the catalogue: rho under a white sky, up to the edge of a floor that alone spans the
// scene, and whose corners lie on the ball through which the sky's rays are sent.
TEST(LightPathStability, L21RaysAtTheEdgeOfTheScene) {
  TestScene t = AboveFloor(2);
  t.ConstantEnvironment(Rgb::Gray(1));
  t.AddShape(MeshShape{Floor(&t, 0.5f)}, t.Diffuse(Rgb::Gray(kRho)));
  const Mean mean = RedOf(t, TechniqueSet::kLight, DrawCount(512, 8192), 1);
  EXPECT_LT(mean.standard_error, 0.01 * static_cast<double>(kRho));
  ExpectHardCase({.row = "L21",
                  .figure = "radiance of a floor that is the scene",
                  .expected = kRho,
                  .measured = mean.value,
                  .standard_error = mean.standard_error,
                  .naive = kRho * (std::numbers::pi_v<float> / 4),
                  .naive_by = "a disk as wide as the floor"});
}

// Expected by the catalogue: a lamp in the face of a box of fog lights the room as the camera finds
// it. The boundary must be crossed once by each ray, whichever side rounding puts the lamp on.
TEST(LightPathStability, L22LampInTheFaceOfAMedium) {
  TestScene t = OpenBox({1});
  PointLight lamp;
  lamp.intensity.rgb = Rgb::Gray(3);
  lamp.from = {0.5f, 1.4f, 0.5f};
  t.scene.lights.push_back({lamp, {}, {}, {}});
  MediumDescription fog;
  fog.sigma_a.rgb = Rgb::Gray(1);
  t.AddShape(MeshShape{t.Box({-1.5f, 0.1f, -1}, {0.5f, 1.9f, 1.5f})},
             t.AddMaterial(InterfaceMaterial{}))
      .media.inside = 0;
  t.scene.media.push_back(std::move(fog));
  const Mean camera = RedOf(t, TechniqueSet::kCamera, 256, 2);
  const Mean light = RedOf(t, TechniqueSet::kLight, DrawCount(512, 8192), 2);
  const double error = std::hypot(camera.standard_error, light.standard_error) / camera.value;
  EXPECT_LT(error, 0.02);
  ExpectHardCase({.row = "L22",
                  .figure = "light paths over camera paths",
                  .expected = 1,
                  .measured = light.value / camera.value,
                  .standard_error = error,
                  .naive = 0.5,
                  .naive_by = "rays that all begin on one side"});
}

// Expected by the catalogue: a room that is 2^20 times as large or small has the same bits.
TEST(LightPathStability, G2LightPathsAtEveryScale) {
  const double unit = RedOf(LitRoom(1), TechniqueSet::kLight, 32, 4).value;
  EXPECT_GT(unit, 0);
  for (const double scale : {0x1p-20, 0x1p20}) {
    EXPECT_EQ(RedOf(LitRoom(scale), TechniqueSet::kLight, 32, 4).value, unit) << scale;
  }
}

}  // namespace
}  // namespace sheaf::render
