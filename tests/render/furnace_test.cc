// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// White furnaces (A3): objects that reflect or transmit all light are invisible under a constant
// sky. Each mean is tested against 1; the tolerance is that of ExpectMean, widened where noted.
#include <gtest/gtest.h>

#include <numbers>

#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr int kDepth = 1000;

TestScene UnderAnEvenSky() {
  TestScene t({0, 0, -4}, {0, 0, 0}, 40);
  t.ConstantEnvironment(Rgb::Gray(1));
  return t;
}
SphereShape Ball() { return SphereShape{1, -1, 1, 360}; }

TEST(FurnaceTest, DiffuseBallVanishes) {
  TestScene t = UnderAnEvenSky();
  t.AddShape(Ball(), t.Diffuse(Rgb::Gray(1)));
  ExpectMean(RenderMean(t.scene, SquareSettings(12, 64, kDepth)), Rgb::Gray(1));
}

TEST(FurnaceTest, ConcaveCornerVanishes) {
  TestScene t({2, 2, 2}, {0, 0, 0}, 30);
  t.ConstantEnvironment(Rgb::Gray(1));
  const int32_t white = t.Diffuse(Rgb::Gray(1));
  t.AddShape(MeshShape{t.Quad({0, 0, 0}, {0, 0, 3}, {3, 0, 3}, {3, 0, 0})}, white);
  t.AddShape(MeshShape{t.Quad({0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {0, 3, 0})}, white);
  t.AddShape(MeshShape{t.Quad({0, 0, 0}, {0, 3, 0}, {0, 3, 3}, {0, 0, 3})}, white);
  ExpectMean(RenderMean(t.scene, SquareSettings(12, 128, kDepth)), Rgb::Gray(1));
}

TEST(FurnaceTest, SmoothGlassVanishes) {
  TestScene t = UnderAnEvenSky();
  t.AddShape(Ball(), t.AddMaterial(DielectricMaterial{}));
  ExpectMean(RenderMean(t.scene, SquareSettings(12, 64, kDepth)), Rgb::Gray(1));
}

TEST(FurnaceTest, ThinGlassVanishes) {
  TestScene t = UnderAnEvenSky();
  t.AddShape(Ball(), t.AddMaterial(ThinDielectricMaterial{}));
  ExpectMean(RenderMean(t.scene, SquareSettings(12, 64, kDepth)), Rgb::Gray(1));
}

// For rough surfaces: energy compensation restores the loss of single scattering to the half
// percent of its tables (M2).
void ExpectNearOne(const TileMean& mean) {
  EXPECT_EQ(mean.non_finite, 0u);
  EXPECT_NEAR(mean.mean.g, 1, 5 * static_cast<double>(mean.standard_error.g) + 0.005);
}

TEST(FurnaceTest, RoughMirrorVanishes) {
  for (const float roughness : {0.0f, 0.1f, 0.5f, 1.0f}) {
    SCOPED_TRACE(roughness);
    TestScene t = UnderAnEvenSky();
    ConductorMaterial metal;
    metal.roughness = {{roughness, kNone}, {roughness, kNone}, false};
    metal.has_reflectance = true;
    metal.reflectance.value.rgb = Rgb::Gray(1);
    t.AddShape(Ball(), t.AddMaterial(metal));
    ExpectNearOne(RenderMean(t.scene, SquareSettings(12, 256, kDepth)));
  }
}

TEST(FurnaceTest, CoatedPerfectMetalVanishes) {
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    for (const float roughness : {0.0f, 0.3f}) {
      SCOPED_TRACE(roughness);
      TestScene t = UnderAnEvenSky();
      CoatedConductorMaterial metal;
      metal.roughness = {{roughness, kNone}, {roughness, kNone}, false};
      metal.conductor.roughness = {{0.2f, kNone}, {0.2f, kNone}, false};
      metal.conductor.has_reflectance = true;
      metal.conductor.reflectance.value.rgb = Rgb::Gray(1);
      metal.thickness = 0;
      t.AddShape(Ball(), t.AddMaterial(metal));
      FrameSettings settings = SquareSettings(12, 256, kDepth);
      settings.color = color;
      ExpectNearOne(RenderMean(t.scene, settings));
    }
  }
}

TEST(FurnaceTest, RoughGlassVanishes) {
  for (const float roughness : {0.1f, 0.5f}) {
    SCOPED_TRACE(roughness);
    TestScene t = UnderAnEvenSky();
    DielectricMaterial glass;
    glass.roughness = {{roughness, kNone}, {roughness, kNone}, false};
    t.AddShape(Ball(), t.AddMaterial(glass));
    ExpectNearOne(RenderMean(t.scene, SquareSettings(12, 256, kDepth)));
  }
}

// Light inside the ball crosses its wall many times.
TEST(FurnaceTest, LosslessSheetVanishes) {
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    TestScene t = UnderAnEvenSky();
    DiffuseTransmissionMaterial sheet;
    sheet.reflectance.value.rgb = Rgb::Gray(0.3f);
    sheet.transmittance.value.rgb = Rgb::Gray(0.7f);
    t.AddShape(Ball(), t.AddMaterial(sheet));
    FrameSettings settings = SquareSettings(12, 256, kDepth);
    settings.color = color;
    const TileMean mean = RenderMean(t.scene, settings);
    EXPECT_EQ(mean.non_finite, 0u);
    EXPECT_NEAR(mean.mean.g, 1, 5 * static_cast<double>(mean.standard_error.g) + 5e-4);
  }
}

// Lit from behind, a sheet shows transmittance / pi times its irradiance, from either side.
TEST(FurnaceTest, SheetsTransmitLight) {
  for (const double light_z : {1.0, -1.0}) {
    TestScene t({0, 0, -4 * light_z}, {0, 0, 0}, 10);
    DistantLight sun;
    sun.radiance.rgb = {1, 2, 3};
    sun.from = {0, 0, light_z};
    sun.to = {0, 0, 0};
    t.scene.lights.push_back({sun, {}, {}, {}});
    DiffuseTransmissionMaterial sheet;
    sheet.reflectance.value.rgb = {0.9f, 0.1f, 0.2f};
    sheet.transmittance.value.rgb = {0.1f, 0.8f, 0.4f};
    sheet.scale = 0.5f;
    t.AddShape(MeshShape{t.Quad({-3, -3, 0}, {-3, 3, 0}, {3, 3, 0}, {3, -3, 0})},
               t.AddMaterial(sheet));
    const TileMean mean = RenderMean(t.scene, SquareSettings(4, 4, 4));
    const Rgb expected{0.05f, 0.8f, 0.6f};
    for (size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(mean.mean[c], expected[c] / std::numbers::pi_v<float>, 1e-5f) << c;
  }
}

TEST(FurnaceTest, InterfacesCutOutsAndMixesVanish) {
  TestScene t = UnderAnEvenSky();
  const int32_t nothing = t.AddMaterial(InterfaceMaterial{}), white = t.Diffuse(Rgb::Gray(1));
  MixMaterial mix;
  mix.material[0] = nothing;
  mix.material[1] = white;
  mix.amount.value = 0.3f;
  t.AddShape(Ball(), nothing);
  ShapeDescription& lace = t.AddShape(SphereShape{0.8f, -0.8f, 0.8f, 360}, white);
  lace.has_alpha = true;
  lace.alpha.value = 0.4f;
  t.AddShape(SphereShape{0.5f, -0.5f, 0.5f, 360}, t.AddMaterial(mix));
  ExpectMean(RenderMean(t.scene, SquareSettings(12, 128, kDepth)), Rgb::Gray(1));
}

TEST(FurnaceTest, InstancesVanish) {
  TestScene t = UnderAnEvenSky();
  const int32_t white = t.Diffuse(Rgb::Gray(1));
  t.AddLooseShape(Ball(), white, ScaleMatrix({0.5, 0.5, 0.5}));
  t.AddLooseShape(MeshShape{t.Box({-0.4f, 0.6f, -0.4f}, {0.4f, 1.2f, 0.4f})}, white);
  t.scene.objects.push_back({"pair", {0, 1}, {}});
  for (const double x : {-1.0, 0.0, 1.0}) {
    ObjectInstance instance;
    instance.object = 0;
    instance.world_from_instance.start = instance.world_from_instance.end =
        TranslateMatrix({x, 0, 0}) * RotateMatrix(40 * x, {0, 0, 1}) * ScaleMatrix({0.8, 1, -1.3});
    t.scene.instances.push_back(instance);
  }
  ExpectMean(RenderMean(t.scene, SquareSettings(16, 128, kDepth)), Rgb::Gray(1));
}

// Thin shapes that are intersected in double precision: white on both sides.
BilinearMeshShape Saddle(TestScene* t) {
  BilinearMesh mesh;
  mesh.positions = {{-1, -1, 0.6f}, {1, -1, -0.6f}, {-1, 1, -0.6f}, {1, 1, 0.6f}};
  mesh.indices = {0, 1, 2, 3};
  t->scene.bilinear_meshes.push_back(mesh);
  return {static_cast<int32_t>(t->scene.bilinear_meshes.size() - 1)};
}

TEST(FurnaceTest, CylindersAndPatchesVanish) {
  TestScene t = UnderAnEvenSky();
  const int32_t white = t.Diffuse(Rgb::Gray(1));
  const Matrix4 place = TranslateMatrix({-0.6, 0, 0}) * RotateMatrix(50, {1, 1, 0});
  t.AddShape(CylinderShape{0.5f, -1, 0.8f, 250}, white, place * ScaleMatrix({1, 0.5, 1}));
  t.AddShape(Saddle(&t), white, TranslateMatrix({0.5, 0, 0}) * RotateMatrix(30, {0, 1, 0}));
  ExpectMean(RenderMean(t.scene, SquareSettings(16, 128, kDepth)), Rgb::Gray(1));
}

TEST(FurnaceTest, PlacedAndMovingCylindersAndPatchesVanish) {
  TestScene t = UnderAnEvenSky();
  t.scene.camera.shutter_close = 1;
  const int32_t white = t.Diffuse(Rgb::Gray(1));
  t.AddLooseShape(CylinderShape{0.3f, -1, 1, 360}, white, RotateMatrix(60, {1, 0, 0}));
  t.AddLooseShape(Saddle(&t), white, ScaleMatrix({0.5, -0.5, 0.7}));
  t.scene.objects.push_back({"pair", {0, 1}, {}});
  ObjectInstance instance;
  instance.object = 0;
  instance.world_from_instance.start = instance.world_from_instance.end =
      TranslateMatrix({-0.6, 0.2, 0}) * ScaleMatrix({0.8, 1, -1.3});
  t.scene.instances.push_back(instance);
  t.AddShape(CylinderShape{0.2f, -0.5f, 0.5f, 200}, white).world_from_object.end =
      TranslateMatrix({1, 0, 0}) * RotateMatrix(80, {1, 0, 0});
  t.AddShape(Saddle(&t), white).world_from_object.end =
      TranslateMatrix({0.5, 0.5, 0}) * RotateMatrix(40, {0, 0, 1}) * ScaleMatrix({0.5, 0.6, 1});
  ExpectMean(RenderMean(t.scene, SquareSettings(16, 128, kDepth)), Rgb::Gray(1));
}

// Emissive quadrics without light sampling of their own act as triangles, with an error of 4e-4:
// half a disk gives half the irradiance of the whole, which is pi / 2 at a distance of its radius;
// a stretched sphere of radius R at distance d gives nearly pi R^2 / d^2.
TEST(LightOfQuadricsTest, PartialAndStretchedQuadricsEmitAsTriangles) {
  const auto lit_by = [](auto shape, const Matrix4& place) {
    TestScene t({0, 0.2, -0.2}, {0, 0, 0}, 0.1f);
    t.AddShape(MeshShape{t.Quad({-9, 0, -9}, {-9, 0, 9}, {9, 0, 9}, {9, 0, -9})},
               t.Diffuse(Rgb::Gray(1)));
    const int32_t light = t.AreaLight(Rgb::Gray(1), /*two_sided=*/true);
    t.AddShape(shape, t.Diffuse({}), place).area_light = light;
    return RenderMean(t.scene, SquareSettings(8, 1024, 1));
  };
  const auto expect = [](const TileMean& mean, double irradiance) {
    const double expected = irradiance / std::numbers::pi;
    EXPECT_EQ(mean.non_finite, 0u);
    EXPECT_NEAR(mean.mean.g, expected,
                5 * static_cast<double>(mean.standard_error.g) + 1e-3 * expected);
  };
  const Matrix4 down = TranslateMatrix({0, 1, 0}) * RotateMatrix(90, {1, 0, 0});
  expect(lit_by(DiskShape{1, 0, 0, 180}, down), std::numbers::pi / 4);
  expect(
      lit_by(SphereShape{1, -1, 1, 360}, TranslateMatrix({0, 3, 0}) * ScaleMatrix({1, 1.0001, 1})),
      std::numbers::pi / 9);
}

// The inside of a sphere that emits on both sides has radiance L / (1 - reflectance) in total; its
// outside receives no light from itself.
TEST(LightOfQuadricsTest, TwoSidedSpheresEmitInside) {
  const auto seen_from = [](Vec3d eye) {
    TestScene t(eye, {0, 0, 0}, 10);
    const int32_t light = t.AreaLight(Rgb::Gray(1), /*two_sided=*/true);
    t.AddShape(Ball(), t.Diffuse(Rgb::Gray(0.6f))).area_light = light;
    return RenderMean(t.scene, SquareSettings(8, 256, kDepth));
  };
  ExpectMean(seen_from({0.3, 0.2, -0.4}), Rgb::Gray(2.5f));
  const TileMean outside = seen_from({0.3, 0.2, -4});
  EXPECT_EQ(outside.mean.g, 1);
  EXPECT_EQ(outside.standard_error.g, 0);
}

}  // namespace
}  // namespace sheaf::render
