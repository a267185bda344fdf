// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/emitter_list.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::render {
namespace {

SceneDescription OneLight() {
  SceneDescription scene;
  AreaLightDescription light;
  light.radiance.rgb = {1, 2, 3};
  scene.area_lights = {light};
  return scene;
}

// Two flat quads of a floor with a step between them, and what the light table is given of them.
BakedMesh Steps() {
  BakedMesh mesh;
  mesh.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0},
                    {1, 1, 0}, {1, 1, 1}, {2, 1, 1}, {2, 1, 0}};
  mesh.indices = {0, 1, 2, 2, 3, 0, 4, 5, 6, 6, 7, 4};
  return mesh;
}
std::vector<TriangleEmitter> EmittersOf(BakedMesh* mesh) {
  const SceneDescription scene = OneLight();
  EmitterList emitters(scene, {});
  EXPECT_EQ(emitters.AddMesh(0, mesh), 0u);
  return emitters.Take().triangles;
}
Vec3f NormalOf(const TriangleEmitter& t) { return Cross(t.v1 - t.v0, t.v2 - t.v0); }
Vec3f SecondNormalOf(const TriangleEmitter& t) { return Cross(t.v1 - t.v2, t.v3 - t.v2); }

TEST(EmitterListTest, FlatQuadsAreOneEmitterEach) {
  BakedMesh mesh = Steps();
  const std::vector<TriangleEmitter> emitters = EmittersOf(&mesh);
  EXPECT_EQ(mesh.surface.emitter_shift, 1);
  ASSERT_EQ(emitters.size(), 2u);
  for (const TriangleEmitter& e : emitters) {
    EXPECT_TRUE(e.is_quad);
    EXPECT_EQ(NormalOf(e), (Vec3f{0, 1, 0}));
    EXPECT_EQ(SecondNormalOf(e), (Vec3f{0, 1, 0}));
    EXPECT_EQ(e.radiance.rgb, (Rgb{1, 2, 3}));
  }
  const TriangleEmitter& step = emitters[1];
  EXPECT_EQ(step.v0 + step.v3, step.v1 + step.v2);  // A parallelogram's diagonals.
}

// Whichever corner a face begins at, and where its vertices are not shared.
TEST(EmitterListTest, QuadsAreFoundHoweverTheyAreWrittenDown) {
  for (uint32_t first = 0; first < 3; ++first) {
    for (uint32_t second = 0; second < 3; ++second) {
      BakedMesh mesh = Steps();
      mesh.positions.insert(mesh.positions.end(), {mesh.positions[2], mesh.positions[0]});
      mesh.indices = {0, 1, 2, 8, 3, 9};
      std::rotate(mesh.indices.begin(), mesh.indices.begin() + first, mesh.indices.begin() + 3);
      std::rotate(mesh.indices.begin() + 3, mesh.indices.begin() + 3 + second, mesh.indices.end());
      const std::vector<TriangleEmitter> emitters = EmittersOf(&mesh);
      ASSERT_EQ(emitters.size(), 1u);
      EXPECT_EQ(NormalOf(emitters[0]), (Vec3f{0, 1, 0}));
      EXPECT_EQ(SecondNormalOf(emitters[0]), (Vec3f{0, 1, 0}));
    }
  }
}

TEST(EmitterListTest, QuadsOfAReversedShapeShineFromTheirOtherSide) {
  BakedMesh mesh = Steps();
  mesh.surface.flips_normal = true;
  for (const TriangleEmitter& e : EmittersOf(&mesh)) {
    EXPECT_EQ(NormalOf(e), (Vec3f{0, -1, 0}));
    EXPECT_EQ(SecondNormalOf(e), (Vec3f{0, -1, 0}));
  }
}

TEST(EmitterListTest, OtherMeshesHaveAnEmitterForEachTriangle) {
  const auto expect_triangles = [](BakedMesh mesh) {
    const size_t count = mesh.indices.size() / 3;
    const std::vector<TriangleEmitter> emitters = EmittersOf(&mesh);
    EXPECT_EQ(mesh.surface.emitter_shift, 0);
    EXPECT_EQ(emitters.size(), count);
    for (const TriangleEmitter& e : emitters) EXPECT_FALSE(e.is_quad);
  };
  BakedMesh odd = Steps();
  odd.indices.resize(9);
  expect_triangles(odd);
  BakedMesh bent = Steps();
  bent.positions[7].y += 1e-5f;
  expect_triangles(bent);
  BakedMesh apart = Steps();
  std::rotate(apart.indices.begin(), apart.indices.begin() + 3, apart.indices.end());
  expect_triangles(apart);
  BakedMesh wound_both_ways = Steps();
  std::swap(wound_both_ways.indices[3], wound_both_ways.indices[4]);
  expect_triangles(wound_both_ways);
  // Vertex normals that turn the second face to the other side.
  BakedMesh turned = Steps();
  turned.indices.resize(6);
  turned.normals.assign(8, {0, 1, 0});
  turned.normals[3] = {0, -3, 0};
  expect_triangles(turned);
}

}  // namespace
}  // namespace sheaf::render
