// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of displaced meshes: cracks, creases, seams, scale, and unchanged meshes.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/globe.h"
#include "tests/support/long_tests.h"
#include "tests/support/test_scene.h"
#include "tests/support/traced_scene.h"
#include "worker/render/geometry/displaced_mesh.h"
#include "worker/render/geometry/leak_guard.h"
#include "worker/render/scene/displacement.h"

namespace sheaf::render {
namespace {

constexpr uint64_t kManyTriangles = 1000000;

TriangleMesh MeshOf(const Triangles& triangles) {
  TriangleMesh mesh;
  mesh.positions = triangles.positions;
  mesh.indices = triangles.indices;
  return mesh;
}
TriangleMesh Displaced(const TriangleMesh& mesh, double edge_length, const HeightFunction& height) {
  absl::StatusOr<TriangleMesh> displaced =
      DisplaceMesh(mesh, Affine{}, edge_length, kManyTriangles, height);
  EXPECT_TRUE(displaced.ok()) << displaced.status();
  return displaced.ok() ? *std::move(displaced) : TriangleMesh{};
}
// A displacement that jumps at every edge of a mesh without uvs, and between its triangles.
float Rugged(Vec2f uv, Vec3d p) {
  return 0.15f * std::sin(37 * uv.x + 11 * uv.y) + 0.1f * static_cast<float>(std::sin(9 * p.x));
}

// Edges, identified by the positions of their ends, are used equally often in both directions:
// there are no cracks, whatever the displacement on the two sides of an edge.
TEST(DisplacementStability, ClosedMeshesStayClosed) {
  for (const auto& [rings, sectors] : {std::pair{4, 7}, std::pair{12, 24}, std::pair{3, 90}}) {
    const TriangleMesh globe = MeshOf(Globe({0.3, -0.2, 0.1}, rings, sectors));
    for (const double edge_length : {0.5, 0.11, 0.02}) {
      const TriangleMesh mesh = Displaced(globe, edge_length, Rugged);
      EXPECT_GE(mesh.indices.size(), globe.indices.size());
      EXPECT_EQ(EnclosedSideOf(mesh.positions, mesh.indices), EnclosedSide::kBack)
          << rings << " rings, edges of " << edge_length;
    }
  }
}

// 3 x 10^4 (SHEAF_LONG_TESTS: 3 x 10^6) rays from the inside of a displaced globe to its vertices,
// middles of edges and triangles: none escapes.
TEST(DisplacementStability, NoRayLeavesADisplacedGlobe) {
  const TriangleMesh mesh = Displaced(MeshOf(Globe({0, 0, 0}, 12, 24)), 0.05, Rugged);
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  t.AddShape(MeshShape{t.AddMesh(mesh.positions, mesh.indices)}, kNone);
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  Random random(8);
  int escapes = 0;
  for (int i = 0; i < DrawCount(30000, 3000000); ++i) {
    const auto triangle =
        static_cast<size_t>(random.Uniform() * static_cast<double>(mesh.indices.size() / 3));
    const auto corner = [&](size_t k) { return mesh.positions[mesh.indices[3 * triangle + k]]; };
    Ray ray;
    ray.o = random.Direction() * 0.1f;
    const Vec3f target = i % 3 == 0   ? corner(0)
                         : i % 3 == 1 ? (corner(0) + corner(1)) * 0.5f
                                      : corner(0) * 0.2f + corner(1) * 0.3f + corner(2) * 0.5f;
    ray.d = target - ray.o;
    RawHit hit;
    escapes += !scene->tracer->Intersect(ray, &hit);
    escapes += !scene->tracer->Occluded(ray);
  }
  EXPECT_EQ(escapes, 0);
}

// A sphere displaced by a constant is a larger sphere, except for the initial deviation of its
// triangles: an edge of length h is at most h^2 / 8 below the sphere. The longest edge of this
// globe is the diagonal of a square of side pi/64, 0.0694, so it is at most 0.0006 below. The same
// holds for the normals.
TEST(DisplacementStability, ConstantDisplacementOfASphereIsALargerSphere) {
  for (const bool has_normals : {false, true}) {
    TriangleMesh globe = MeshOf(Globe({0, 0, 0}, 64, 128));
    if (has_normals) globe.normals = globe.positions;
    const TriangleMesh mesh = Displaced(globe, 0.02, [](Vec2f, Vec3d) { return 0.25f; });
    for (size_t i = 0; i < mesh.positions.size(); ++i) {
      const Vec3d p = ToDouble(mesh.positions[i]);
      ASSERT_LE(Length(p), 1.25 + 1e-6);
      ASSERT_GE(Length(p), 1.25 - 0.0007);
      // Facets of the first globe are flat: their normals deviate by half an edge over the radius.
      ASSERT_GT(Dot(ToDouble(mesh.normals[i]), p) / Length(p), 1 - 0.5 * 0.0694 * 0.0694);
    }
  }
}

// Refined edges are short enough, and no angle is less than half the smallest of the mesh
// (Rosenberg and Stenger 1975). uvs are unchanged: on this square they equal the position.
TEST(DisplacementStability, RefinementKeepsAnglesAndUvs) {
  TriangleMesh square;
  square.positions = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  square.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  square.indices = {0, 1, 2, 0, 2, 3};
  const TriangleMesh mesh = Displaced(square, 0.07, [](Vec2f, Vec3d) { return 0.5f; });
  double area = 0;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    for (size_t k = 0; k < 3; ++k) {
      const auto corner = [&](size_t c) {
        return ToDouble(mesh.positions[mesh.indices[i + (k + c) % 3]]);
      };
      const Vec3d a = corner(1) - corner(0), b = corner(2) - corner(0);
      EXPECT_LE(Length(a), 0.07);
      EXPECT_GE(std::atan2(Length(Cross(a, b)), Dot(a, b)), 22.5 * 3.14159265 / 180 - 1e-6);
      area += Cross(a, b).z / 6;
    }
  }
  EXPECT_NEAR(area, 1, 1e-6);
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    EXPECT_EQ(mesh.uvs[i].x, mesh.positions[i].x);
    EXPECT_EQ(mesh.uvs[i].y, mesh.positions[i].y);
    EXPECT_EQ(mesh.positions[i].z, 0.5f);
    EXPECT_EQ(mesh.normals[i], (Vec3f{0, 0, 1}));
  }
}

// The faces of a box with their own vertices and normals move apart without opening a gap; they
// stay flat except for the row of triangles at the crease.
TEST(DisplacementStability, CreasesStayClosed) {
  TestScene t({0, 0, 0}, {0, 0, 1}, 60);
  const TriangleMesh box = t.scene.meshes[static_cast<size_t>(t.Box({-1, -1, -1}, {1, 1, 1}))];
  TriangleMesh split;
  for (size_t i = 0; i < box.indices.size(); i += 3) {
    const auto p = [&](size_t k) { return box.positions[box.indices[i + k]]; };
    const Vec3f n = Normalize(Cross(p(1) - p(0), p(2) - p(0)));
    for (size_t k = 0; k < 3; ++k) {
      split.indices.push_back(static_cast<uint32_t>(split.positions.size()));
      split.positions.push_back(p(k));
      split.normals.push_back(n);
    }
  }
  const TriangleMesh mesh = Displaced(split, 0.1, [](Vec2f, Vec3d) { return 0.25f; });
  EXPECT_EQ(EnclosedSideOf(mesh.positions, mesh.indices), EnclosedSide::kBack);
  size_t flat = 0;
  for (const Vec3f& p : mesh.positions) {
    flat += std::fmax(std::fabs(p.x), std::fmax(std::fabs(p.y), std::fabs(p.z))) == 1.25f;
  }
  EXPECT_GT(flat, mesh.positions.size() / 2);
}

// A mesh without any displacement is unchanged: the image keeps its bits.
TEST(DisplacementStability, NoDisplacementChangesNoBit) {
  const FrameSettings settings = SquareSettings(12, 16, 5);
  TestScene t = LitRoom(1);
  CheckerboardTexture nothing;  // Zero everywhere, but not folded into a constant.
  nothing.value[0].value = nothing.value[1].value = 0;
  TextureDescription texture;
  texture.texture = nothing;
  t.scene.textures.push_back(texture);
  auto& walls = std::get<MeshShape>(t.scene.shapes[0].shape);
  walls.displacement.texture = 0;
  walls.edge_length = 0.2f;
  EXPECT_TRUE(RenderAll(*Compile(t.scene, settings)) ==
              RenderAll(*Compile(LitRoom(1).scene, settings)));
}

// Scaling by powers of two gives the same mesh to the bit, whether its coordinates or its transform
// is scaled.
TEST(DisplacementStability, PowersOfTwoChangeNoBit) {
  const TriangleMesh globe = MeshOf(Globe({0.3, -0.2, 0.1}, 9, 13));
  const TriangleMesh still = Displaced(globe, 0.1, Rugged);
  for (const int exponent : {-30, -3, 5, 40}) {
    const double scale = std::ldexp(1.0, exponent);
    const auto factor = static_cast<float>(scale);
    TriangleMesh large = globe;
    for (Vec3f& p : large.positions) p = p * factor;
    const TriangleMesh scaled = Displaced(large, 0.1 * scale, [&](Vec2f uv, Vec3d p) {
      return factor * Rugged(uv, p * (1 / scale));
    });
    ASSERT_EQ(scaled.indices, still.indices);
    EXPECT_EQ(scaled.normals, still.normals);
    for (size_t i = 0; i < still.positions.size(); ++i) {
      ASSERT_EQ(scaled.positions[i], still.positions[i] * factor);
    }
    Affine larger;
    larger.x.x = larger.y.y = larger.z.z = scale;
    const absl::StatusOr<TriangleMesh> placed =
        DisplaceMesh(globe, larger, 0.1 * scale, kManyTriangles, Rugged);
    ASSERT_TRUE(placed.ok());
    EXPECT_EQ(placed->indices, still.indices);
    EXPECT_EQ(placed->positions, still.positions);
  }
}

TEST(DisplacementStability, LimitsAndInvalidNumbersAreErrors) {
  TestScene t = LitRoom(1);
  auto& walls = std::get<MeshShape>(t.scene.shapes[0].shape);
  walls.displacement.value = 0.1f;
  walls.edge_length = 1e-30f;
  t.scene.shapes[0].location = {0, 12, 3};
  TableFileSource files({});
  CompileLimits limits;
  limits.displaced_triangles_max = 1000;
  const auto compiled = CompileScene(t.scene, SquareSettings(4, 1, 1), files, limits);
  ASSERT_FALSE(compiled.ok());
  EXPECT_EQ(compiled.status().code(), absl::StatusCode::kResourceExhausted);
  const std::string said(compiled.status().message());
  EXPECT_NE(said.find("test.pbrt:12:3: Shape: the displaced mesh exceeds the limit of 1000"),
            std::string::npos)
      << said;
  const TriangleMesh globe = MeshOf(Globe({0, 0, 0}, 4, 4));
  EXPECT_FALSE(DisplaceMesh(globe, Affine{}, 1, 1000, [](Vec2f, Vec3d) { return NAN; }).ok());
}

// Shapes with the same mesh, texture and size share the displaced mesh.
TEST(DisplacementStability, EqualMeshesAreShared) {
  TestScene t({0, 0, -5}, {0, 0, 0}, 60);
  const int32_t box = t.Box({-1, -1, -1}, {1, 1, 1});
  for (const bool is_solid : {false, true}) {
    CheckerboardTexture board;
    board.dimensions = is_solid ? 3 : 2;
    board.value[0].value = 0.25f;
    TextureDescription texture;
    texture.texture = board;
    t.scene.textures.push_back(texture);
  }
  const auto add = [&](int32_t texture, const Matrix4& transform) {
    MeshShape shape{box};
    shape.displacement.texture = texture;
    t.AddShape(shape, kNone, transform);
  };
  add(0, {});
  add(0, TranslateMatrix({3, 0, 0}));
  add(0, ScaleMatrix({2, 2, 2}));
  add(1, {});
  add(1, TranslateMatrix({3, 0, 0}));
  TableFileSource files({});
  ASSERT_TRUE(DisplaceMeshes(files, {kManyTriangles, uint64_t{1} << 20}, &t.scene).ok());
  const auto mesh_of = [&](size_t i) { return std::get<MeshShape>(t.scene.shapes[i].shape).mesh; };
  EXPECT_EQ(mesh_of(0), mesh_of(1));
  EXPECT_NE(mesh_of(0), mesh_of(2));  // Edges are measured in world space.
  EXPECT_NE(mesh_of(3), mesh_of(4));  // The texture depends on the position.
  EXPECT_EQ(t.scene.meshes.size(), 5u);
  EXPECT_TRUE(t.scene.meshes[static_cast<size_t>(box)].positions.empty());
}

}  // namespace
}  // namespace sheaf::render
