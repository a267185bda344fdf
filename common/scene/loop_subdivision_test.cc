// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/loop_subdivision.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace sheaf {
namespace {

// Faces of an octahedron, counter-clockwise from outside.
const std::vector<Vec3f> kOctahedron = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                        {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
const std::vector<uint32_t> kOctahedronIndices = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                                                  2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};

TEST(LoopSubdivisionTest, LimitIsIndependentOfLevels) {
  // The limit position of a control vertex does not depend on the number of refinements before it.
  const auto coarse = SubdivideLoop(kOctahedron, kOctahedronIndices, 0, 1000000);
  const auto fine = SubdivideLoop(kOctahedron, kOctahedronIndices, 4, 1000000);
  ASSERT_TRUE(coarse.ok() && fine.ok());
  EXPECT_EQ(fine->indices.size(), kOctahedronIndices.size() * 256);
  for (size_t i = 0; i < kOctahedron.size(); ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(coarse->positions[i][axis], fine->positions[i][axis], 1e-6);
    }
  }
}

// Limit positions of control vertices in closed form. With valence n a vertex keeps 1 - n w of
// itself and takes w = 1/5, 1/8, 1/10, 1/12 of each neighbor for n = 3, 4, 5, 6. The solids are
// centered, so that the neighbors' sum is a multiple of the vertex: -1, 0 and sqrt(5) times it.
TEST(LoopSubdivisionTest, LimitsOfPlatonicSolids) {
  const std::vector<Vec3f> tetrahedron = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  const std::vector<uint32_t> tetrahedron_indices = {0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2};
  constexpr float kGolden = 1.61803399f;
  std::vector<Vec3f> icosahedron;
  for (const float a : {-1.0f, 1.0f}) {
    for (const float b : {-kGolden, kGolden}) {
      icosahedron.insert(icosahedron.end(), {Vec3f{0, a, b}, Vec3f{a, b, 0}, Vec3f{b, 0, a}});
    }
  }
  // Its faces are the triples at distance 2 from each other, wound outwards.
  std::vector<uint32_t> icosahedron_indices;
  for (uint32_t i = 0; i < 12; ++i) {
    for (uint32_t j = i + 1; j < 12; ++j) {
      for (uint32_t k = j + 1; k < 12; ++k) {
        const Vec3f p = icosahedron[i], q = icosahedron[j], r = icosahedron[k];
        if (Length(p - q) > 2.1f || Length(q - r) > 2.1f || Length(r - p) > 2.1f) continue;
        const bool is_outward = Dot(Cross(q - p, r - p), p) > 0;
        icosahedron_indices.insert(icosahedron_indices.end(),
                                   {i, is_outward ? j : k, is_outward ? k : j});
      }
    }
  }
  ASSERT_EQ(icosahedron_indices.size(), 60u);
  const struct {
    const std::vector<Vec3f>& points;
    const std::vector<uint32_t>& indices;
    double shrinks_to;
  } cases[] = {
      {tetrahedron, tetrahedron_indices, 1 - 3.0 / 5 - 1.0 / 5},
      {kOctahedron, kOctahedronIndices, 1 - 4.0 / 8},
      {icosahedron, icosahedron_indices, 1 - 5.0 / 10 + std::sqrt(5) / 10},
  };
  for (const auto& c : cases) {
    for (const int32_t levels : {0, 1, 3}) {
      const auto mesh = SubdivideLoop(c.points, c.indices, levels, 1000000);
      ASSERT_TRUE(mesh.ok());
      for (size_t i = 0; i < c.points.size(); ++i) {
        const auto expected = c.points[i] * static_cast<float>(c.shrinks_to);
        EXPECT_NEAR(Length(mesh->positions[i] - expected), 0, 1e-6) << c.points.size() << " " << i;
        // By symmetry the normal is parallel to the vertex's direction (opposite to it, as in
        // pbrt).
        EXPECT_NEAR(Dot(mesh->normals[i], Normalize(c.points[i])), -1, 1e-6);
      }
    }
  }
}

// Valence 6, the regular one: a tip of height 1 in the middle of a flat fan sinks to 1 - 6/12; and
// boundaries are cubic splines: a corner keeps 4/6 and takes 1/6 of either neighbor.
TEST(LoopSubdivisionTest, LimitsOfAFan) {
  std::vector<Vec3f> fan = {{0, 0, 1}};
  std::vector<uint32_t> indices;
  for (uint32_t i = 0; i < 6; ++i) {
    const double angle = std::numbers::pi / 3 * i;
    fan.push_back(ToFloat({std::cos(angle), std::sin(angle), 0}));
    indices.insert(indices.end(), {0, 1 + i, 1 + (i + 1) % 6});
  }
  for (const int32_t levels : {0, 2}) {
    const auto mesh = SubdivideLoop(fan, indices, levels, 1000000);
    ASSERT_TRUE(mesh.ok());
    EXPECT_NEAR(Length(mesh->positions[0] - Vec3f{0, 0, 0.5f}), 0, 1e-6);
    for (size_t i = 1; i <= 6; ++i) {
      EXPECT_NEAR(Length(mesh->positions[i] - fan[i] * (4 / 6.0f + 1 / 6.0f)), 0, 1e-6);
    }
  }
}

TEST(LoopSubdivisionTest, NormalsMatchTheLimitSurface) {
  const auto mesh = SubdivideLoop(kOctahedron, kOctahedronIndices, 3, 1000000);
  ASSERT_TRUE(mesh.ok());
  // Triangles keep the winding of the control mesh, and normals point against it, as in pbrt.
  for (size_t i = 0; i < mesh->indices.size(); i += 3) {
    const Vec3f a = mesh->positions[mesh->indices[i]], b = mesh->positions[mesh->indices[i + 1]],
                c = mesh->positions[mesh->indices[i + 2]];
    const Vec3f outward = Cross(b - a, c - a);
    EXPECT_GT(Dot(outward, a), 0);
    EXPECT_LT(Dot(Normalize(outward), mesh->normals[mesh->indices[i]]), -0.9f);
  }
}

TEST(LoopSubdivisionTest, FlatPatchStaysFlatWithinItsBoundary) {
  const std::vector<Vec3f> square = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  const auto mesh = SubdivideLoop(square, {0, 1, 2, 0, 2, 3}, 3, 1000000);
  ASSERT_TRUE(mesh.ok());
  EXPECT_EQ(mesh->indices.size(), 3u * 2 * 64);
  for (size_t i = 0; i < mesh->positions.size(); ++i) {
    EXPECT_EQ(mesh->positions[i].z, 0);
    EXPECT_EQ(std::fabs(mesh->normals[i].z), 1);
    EXPECT_GE(mesh->positions[i].x, 0);
    EXPECT_LE(mesh->positions[i].x, 1);
  }
}

TEST(LoopSubdivisionTest, ImpossibleMeshesAreRefused) {
  const std::vector<Vec3f> points(5);
  const std::vector<std::vector<uint32_t>> meshes = {
      {0, 1, 2, 0, 1, 3, 1, 0, 4},  // Three triangles at an edge.
      {0, 1, 2, 0, 1, 3},           // Winding differs.
      {0, 1, 2, 0, 3, 4},           // Fans that touch in vertex 0.
      {0, 0, 1},                    // Not a triangle.
  };
  for (const auto& indices : meshes) {
    EXPECT_EQ(SubdivideLoop(points, indices, 1, 1000).status().code(),
              absl::StatusCode::kInvalidArgument);
  }
  EXPECT_EQ(SubdivideLoop(points, {0, 1, 2}, 30, 1000).status().code(),
            absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(SubdivideLoop(points, {0, 1, 2}, INT32_MAX, 1000).status().code(),
            absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace sheaf
