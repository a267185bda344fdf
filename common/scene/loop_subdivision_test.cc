// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/loop_subdivision.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sheaf {
namespace {

// Faces of an octahedron, counter-clockwise from outside.
const std::vector<Vec3f> kOctahedron = {{1, 0, 0},  {-1, 0, 0}, {0, 1, 0},
                                        {0, -1, 0}, {0, 0, 1},  {0, 0, -1}};
const std::vector<uint32_t> kOctahedronIndices = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                                                  2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};

TEST(LoopSubdivisionTest, LimitDoesNotDependOnLevels) {
  // The limit position of a control vertex is the same however often it was refined before.
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

TEST(LoopSubdivisionTest, NormalsAreThoseOfTheSurface) {
  const auto mesh = SubdivideLoop(kOctahedron, kOctahedronIndices, 3, 1000000);
  ASSERT_TRUE(mesh.ok());
  // Triangles that keep the winding of the control mesh, and normals against it, as pbrt has them.
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
      {0, 0, 1},                    // No triangle.
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
