// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Vertex normals at an angle to their faces keep all light above the surface, and let none through:
// rendered scenes with known results.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <vector>

#include "tests/render/lossless_materials.h"
#include "tests/support/test_scene.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using testing::LosslessMaterials;
using testing::NamedMaterial;

enum class Plate { kMesh, kPatches };

Vec3f Tilted(double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  return ToFloat(Vec3d{std::sin(angle), 0, -std::cos(angle)});
}

// A plate that fills the view of a camera on the z axis.
void AddPlate(TestScene* t, Plate kind, double tilt_degrees, int32_t material) {
  const std::vector<Vec3f> normals(4, Tilted(tilt_degrees));
  if (kind == Plate::kMesh) {
    const int32_t mesh = t->Quad({-9, -9, 0}, {-9, 9, 0}, {9, 9, 0}, {9, -9, 0});
    t->scene.meshes.back().normals = normals;
    t->AddShape(MeshShape{mesh}, material);
    return;
  }
  BilinearMesh patches;
  patches.positions = {{-9, -9, 0}, {9, -9, 0}, {-9, 9, 0}, {9, 9, 0}};
  patches.normals = normals;
  patches.indices = {0, 1, 2, 3};
  t->scene.bilinear_meshes.push_back(patches);
  BilinearMeshShape shape;
  shape.mesh = static_cast<int32_t>(t->scene.bilinear_meshes.size() - 1);
  t->AddShape(shape, material);
}

TileMean RenderMean(const SceneDescription& scene, const FrameSettings& settings) {
  return MeanOf(RenderAll(*Compile(scene, settings)));
}

TEST(VertexNormals, WhitePlatesVanishAtEveryTilt) {
  for (const Plate kind : {Plate::kMesh, Plate::kPatches}) {
    for (const double tilt : {0.0, 5.0, 15.0, 30.0, 45.0, 58.0, 75.0, 80.0}) {
      for (const Vec3d from : {Vec3d{0, 0, -4}, Vec3d{3, 0, -1}, Vec3d{-3, 1, -1}}) {
        TestScene t(from, {0, 0, 0}, 20);
        t.ConstantEnvironment(Rgb::Gray(1));
        AddPlate(&t, kind, tilt, t.Diffuse(Rgb::Gray(1)));
        const TileMean mean = RenderMean(t.scene, SquareSettings(16, 64, 4));
        EXPECT_NEAR(mean.mean.g, 1, 4 * static_cast<double>(mean.standard_error.g) + 1e-4)
            << tilt << " seen from x " << from.x;
        EXPECT_LT(mean.standard_error.g, 0.002f);
      }
    }
  }
}

// A ball of few triangles with the normals of a sphere, which tilt by up to 30 degrees.
int32_t AddCoarseBall(TestScene* t) {
  constexpr int kBallRings = 5, kBallSides = 8;
  std::vector<Vec3f> points;
  std::vector<uint32_t> indices;
  for (int i = 0; i <= kBallRings; ++i) {
    for (int j = 0; j < kBallSides; ++j) {
      const double theta = std::numbers::pi * i / kBallRings,
                   phi = 2 * std::numbers::pi * j / kBallSides;
      points.push_back(ToFloat(Vec3d{std::sin(theta) * std::cos(phi), std::cos(theta),
                                     std::sin(theta) * std::sin(phi)}));
    }
  }
  for (uint32_t i = 0; i < kBallRings; ++i) {
    for (uint32_t j = 0; j < kBallSides; ++j) {
      const uint32_t next = (j + 1) % kBallSides;
      const uint32_t a = i * kBallSides + j, b = i * kBallSides + next, c = a + kBallSides,
                     d = b + kBallSides;
      if (i > 0) indices.insert(indices.end(), {a, b, c});
      if (i + 1 < kBallRings) indices.insert(indices.end(), {b, d, c});
    }
  }
  const int32_t mesh = t->AddMesh(points, indices);
  t->scene.meshes.back().normals = points;
  return mesh;
}

TEST(VertexNormals, SmoothBallsOfLosslessMaterialsVanish) {
  std::vector<NamedMaterial> materials = LosslessMaterials();
  materials.push_back({"glass", [](TestScene& t) { return t.AddMaterial(DielectricMaterial{}); }});
  for (const NamedMaterial& material : materials) {
    for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
      SCOPED_TRACE(material.name);
      TestScene t({0, 0.5, -4}, {0, 0, 0}, 30);
      t.ConstantEnvironment(Rgb::Gray(1));
      t.AddShape(MeshShape{AddCoarseBall(&t)}, material.add(t));
      FrameSettings settings = SquareSettings(12, 64, 1000);
      settings.color = color;
      const CompiledScenePtr scene = Compile(t.scene, settings);
      EXPECT_TRUE(Has(PlanOf(*scene).traits, Trait::kVertexNormals));
      const TileMean mean = MeanOf(RenderAll(*scene));
      EXPECT_EQ(mean.non_finite, 0u);
      EXPECT_NEAR(mean.mean.g, 1, 5 * static_cast<double>(mean.standard_error.g) + 0.005);
    }
  }
}

// The normals lean towards the light, which is behind the plate.
TEST(VertexNormals, LightFromBelowTheSurfaceStaysThere) {
  for (const Plate kind : {Plate::kMesh, Plate::kPatches}) {
    for (const double tilt : {15.0, 45.0, 80.0}) {
      TestScene t({0, 0, -4}, {0, 0, 0}, 20);
      DistantLight sun;
      sun.radiance.rgb = Rgb::Gray(1);
      sun.from = {3, 0, 0.5};
      sun.to = {0, 0, 0};
      t.scene.lights.push_back({sun, {}, {}, {}});
      AddPlate(&t, kind, tilt, t.Diffuse(Rgb::Gray(1)));
      const TileMean mean = RenderMean(t.scene, SquareSettings(16, 16, 4));
      EXPECT_EQ(mean.mean.g, 0) << tilt;
    }
  }
}

TEST(VertexNormals, ParallelNormalsCostNothing) {
  TestScene t({0, 0, -4}, {0, 0, 0}, 20);
  t.ConstantEnvironment(Rgb::Gray(1));
  AddPlate(&t, Plate::kMesh, 0, t.Diffuse(Rgb::Gray(0.5f)));
  EXPECT_FALSE(
      Has(PlanOf(*Compile(t.scene, SquareSettings(8, 4, 4))).traits, Trait::kVertexNormals));
  t.scene.meshes.back().normals.assign(4, Tilted(5));
  EXPECT_TRUE(
      Has(PlanOf(*Compile(t.scene, SquareSettings(8, 4, 4))).traits, Trait::kVertexNormals));
}

// Stretching a plate across its normals turns them further.
TEST(VertexNormals, StretchedInstancesTiltTheirNormals) {
  const auto traits = [](double stretch) {
    TestScene t({0, 0, -4}, {0, 0, 0}, 20);
    t.ConstantEnvironment(Rgb::Gray(1));
    const int32_t mesh = t.Quad({-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0});
    t.scene.meshes.back().normals.assign(4, Tilted(1));
    t.AddLooseShape(MeshShape{mesh}, t.Diffuse(Rgb::Gray(0.8f)));
    t.scene.objects.push_back({"plate", {0}, {}});
    ObjectInstance instance;
    instance.object = 0;
    instance.world_from_instance.start = instance.world_from_instance.end =
        ScaleMatrix({1, 1, stretch});
    t.scene.instances.push_back(instance);
    return PlanOf(*Compile(t.scene, SquareSettings(8, 4, 4))).traits;
  };
  EXPECT_FALSE(Has(traits(1), Trait::kVertexNormals));
  EXPECT_TRUE(Has(traits(20), Trait::kVertexNormals));
}

}  // namespace
}  // namespace sheaf::render
