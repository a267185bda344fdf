// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Points and lines, what colors of vertices emit, and GLB files whose chunks end within a word.
#include "common/scene/gltf/thin_shapes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/scene/derived_files.h"
#include "common/scene/gltf/vertex_emission.h"
#include "tests/support/gltf_text.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

// The accessor of positions with the bounds that the format demands: a diagonal of sqrt(2).
std::string BoundedAccessors() {
  std::string accessors = testing::kAccessors;
  accessors.replace(accessors.find(R"("count": 3, "type": "VEC3")"), 26,
                    R"("count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0])");
  return accessors;
}

absl::StatusOr<ReadSceneResult> ReadMode(int mode, const std::string& node) {
  return testing::Read(testing::File(
      absl::StrCat(R"("materials": [{}], "nodes": [{"mesh": 0)", node, "}], ",
                   R"("scenes": [{"nodes": [0]}])"),
      absl::StrCat(R"("meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 0},
        "indices": 2, "material": 0, "mode": )",
                   mode, "}]}],"),
      BoundedAccessors()));
}

TEST(GltfThinShapesTest, PointsAreSpheresOfOneSizeInTheWorld) {
  const auto read = ReadMode(0, R"(, "scale": [4, 4, 4])");
  ASSERT_TRUE(read.ok()) << read.status();
  const TriangleMesh& mesh = read->scene.meshes[0];
  ASSERT_EQ(mesh.indices.size(), 3 * gltf::CostOfPoints(3).triangles);
  ASSERT_EQ(mesh.positions.size(), 36u);
  ASSERT_EQ(mesh.colors.size(), 36u);
  // The scene's diagonal is 4 sqrt(2), that of the mesh a quarter of it.
  const double radius = std::sqrt(2.0) * gltf::kPointRadius;
  const Vec3f centers[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (size_t v = 0; v < 36; ++v) {
    const Vec3f center = centers[v / 12];
    EXPECT_NEAR(Length(mesh.positions[v] - center), radius, 1e-6);
    EXPECT_EQ(mesh.colors[v], (VertexColor{center.x, center.y, center.z, 1}));
  }
  // Faces are seen from outside.
  for (size_t t = 0; t < mesh.indices.size(); t += 3) {
    const Vec3f a = mesh.positions[mesh.indices[t]], b = mesh.positions[mesh.indices[t + 1]],
                c = mesh.positions[mesh.indices[t + 2]];
    EXPECT_GT(Dot(Cross(b - a, c - a), mesh.normals[mesh.indices[t]]), 0);
  }
  EXPECT_THAT(testing::Notes(*read), HasSubstr("points are spheres"));
}

TEST(GltfThinShapesTest, LinesAreTubes) {
  const struct {
    int mode;
    size_t segments;
  } cases[] = {{1, 1}, {2, 3}, {3, 2}};  // One pair, a loop, a strip.
  for (const auto& [mode, segments] : cases) {
    const auto read = ReadMode(mode, "");
    ASSERT_TRUE(read.ok()) << read.status();
    const TriangleMesh& mesh = read->scene.meshes[0];
    EXPECT_EQ(mesh.indices.size(), 3 * gltf::CostOfSegments(segments).triangles) << mode;
    // The first segment is along x.
    for (size_t v = 0; v < gltf::CostOfSegments(1).vertices; ++v) {
      const Vec3f p = mesh.positions[v];
      EXPECT_NEAR(std::sqrt(p.y * p.y + p.z * p.z), std::sqrt(2.0) * gltf::kLineRadius, 1e-6);
    }
    for (size_t t = 0; t < mesh.indices.size(); t += 3) {
      const Vec3f a = mesh.positions[mesh.indices[t]], b = mesh.positions[mesh.indices[t + 1]],
                  c = mesh.positions[mesh.indices[t + 2]];
      EXPECT_GT(Dot(Cross(b - a, c - a), mesh.normals[mesh.indices[t]]), 0) << mode;
    }
  }
}

TEST(GltfThinShapesTest, LinesStartAgain) {
  const uint32_t restart = gltf::kRestart;
  using Segments = std::vector<std::pair<uint32_t, uint32_t>>;
  EXPECT_EQ(gltf::SegmentsOf(TINYGLTF_MODE_LINE_STRIP, {0, 1, 2, restart, 3, 4}),
            (Segments{{0, 1}, {1, 2}, {3, 4}}));
  EXPECT_EQ(gltf::SegmentsOf(TINYGLTF_MODE_LINE_LOOP, {0, 1, 2, restart, restart, 3, 4}),
            (Segments{{0, 1}, {1, 2}, {2, 0}, {3, 4}}));
}

// Many points and segments have fewer triangles each, whose faces are seen from outside as well.
TEST(GltfThinShapesTest, ManyAreLessRound) {
  gltf::Primitive primitive;
  primitive.mesh.positions = {{0, 0, 0}, {1, 0, 0}};
  gltf::Primitive lines = primitive;
  const size_t count = gltf::kRoundMax + 1;
  gltf::MakeSpheres(std::vector<uint32_t>(count, 1), 0.5f, &primitive);
  gltf::MakeTubes(std::vector<std::pair<uint32_t, uint32_t>>(count, {0, 1}), 0.5f, &lines);
  EXPECT_EQ(primitive.mesh.positions.size(), gltf::CostOfPoints(count).vertices);
  EXPECT_EQ(primitive.mesh.indices.size(), 3 * gltf::CostOfPoints(count).triangles);
  EXPECT_EQ(lines.mesh.positions.size(), gltf::CostOfSegments(count).vertices);
  EXPECT_EQ(lines.mesh.indices.size(), 3 * gltf::CostOfSegments(count).triangles);
  for (const TriangleMesh& mesh : {primitive.mesh, lines.mesh}) {
    for (size_t t = 0; t < 24; t += 3) {
      const Vec3f a = mesh.positions[mesh.indices[t]], b = mesh.positions[mesh.indices[t + 1]],
                  c = mesh.positions[mesh.indices[t + 2]];
      EXPECT_GT(Dot(Cross(b - a, c - a), mesh.normals[mesh.indices[t]]), 0);
    }
  }
}

// Without bounds the primitive's own positions count, and 1 where they are one point.
TEST(GltfThinShapesTest, ThicknessNeedsNoBounds) {
  tinygltf::Model model;
  EXPECT_EQ(gltf::SceneDiagonal(model, {}, {}), 0);
  EXPECT_EQ(gltf::DiagonalOf({{1, 2, 3}, {4, 2, 7}}), 5);
  EXPECT_EQ(gltf::DiagonalOf({{1, 2, 3}}), 1);
  Matrix4 nothing;
  for (auto& row : nothing.m) row.fill(0);
  EXPECT_EQ(gltf::LargestScale(nothing), 1);
}

// At the corners of each triangle the image has the colors of its vertices.
TEST(GltfThinShapesTest, UnlitColorsOfVerticesAreEmitted) {
  const std::string folder = ::testing::TempDir();
  EXPECT_TRUE(WriteFileOnce(folder + "/unlit.gltf", testing::File(R"("materials": [
      {"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 1, 1]},
       "extensions": {"KHR_materials_unlit": {}}}],
      "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])",
                                                                  R"("meshes": [{"primitives": [
      {"attributes": {"POSITION": 0, "COLOR_0": 0}, "indices": 2, "material": 0}]}],)"))
                  .ok());
  DirectoryFileSource files(folder, std::make_shared<DerivedFiles>());
  const auto read = ReadGltf("unlit.gltf", files, {}, {});
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->scene.area_lights.size(), 1u);
  const AreaLightDescription& light = read->scene.area_lights[0];
  EXPECT_EQ(light.file, "unlit.gltf.colors-0-0.pfm");
  EXPECT_EQ(light.tint, (Rgb{1, 0.5f, 1}));
  EXPECT_EQ(read->scene.shapes[0].area_light, 0);
  const std::string image = *ReadWholeFile(files.FilesUsed().at(light.file));
  const std::string header = "PF\n2 2\n-1.0\n";
  ASSERT_TRUE(image.starts_with(header));
  float texels[2][2][3];  // Rows from the lowest v upwards.
  ASSERT_EQ(image.size(), header.size() + sizeof texels);
  std::memcpy(texels, image.data() + header.size(), sizeof texels);
  const TriangleMesh& mesh = read->scene.meshes[0];
  const Vec3f expected[] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (size_t v = 0; v < 3; ++v) {
    const auto x = static_cast<size_t>(2 * mesh.uvs[v].x),
               y = static_cast<size_t>(2 * mesh.uvs[v].y);
    EXPECT_EQ(2 * mesh.uvs[v].x, static_cast<float>(x) + 0.5f);
    for (size_t c = 0; c < 3; ++c) EXPECT_EQ(texels[y][x][c], expected[v][c]);
  }
}

TEST(GltfThinShapesTest, TrianglesOfTheSameColorsShareASquare) {
  gltf::Primitive primitive;
  TriangleMesh& mesh = primitive.mesh;
  mesh.positions.resize(4);
  mesh.colors = {{1, 0, 0, 1}, {1, 0, 0, 1}, {1, 0, 0, 1}, {1, 0, 0, 1}};
  mesh.indices = {0, 1, 2, 1, 2, 3};
  EXPECT_TRUE(gltf::SeparateColors(&primitive).starts_with("PF\n2 2\n"));
  EXPECT_EQ(mesh.positions.size(), 6u);
  EXPECT_EQ(mesh.uvs[0].x, mesh.uvs[3].x);
}

// Emissive meshes do not move while the shutter is open, and are no reason to refuse the file.
TEST(GltfThinShapesTest, WhatEmitsStaysWhereItIs) {
  GltfView view;
  view.time_s = 0.5;
  view.shutter_s = 0.25;
  const auto read = testing::Read(testing::File(R"("materials": [{"emissiveFactor": [1, 1, 1]}],
      "animations": [{"samplers": [{"input": 3, "output": 4}],
                      "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]}],
      "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}])"),
                                  view);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_FALSE(read->scene.shapes[0].world_from_object.IsAnimated());
  EXPECT_NE(read->scene.shapes[0].area_light, kNone);
  EXPECT_THAT(testing::Notes(*read), HasSubstr("what emits stays where it is"));
}

TEST(GltfThinShapesTest, BinaryChunksMayEndWithinAWord) {
  std::string buffer = testing::Buffer();
  std::string json =
      absl::StrCat(R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": )", buffer.size(),
                   "}],", testing::kAccessors, testing::kMesh, testing::kOneNode, "}");
  json.resize((json.size() + 3) / 4 * 4, ' ');
  buffer += "xy";  // Two bytes of padding alone.
  const auto word = [](size_t value) {
    const auto number = static_cast<uint32_t>(value);
    return std::string(reinterpret_cast<const char*>(&number), sizeof number);
  };
  const std::string glb =
      absl::StrCat("glTF", word(2), word(28 + json.size() + buffer.size()), word(json.size()),
                   "JSON", json, word(buffer.size()), std::string("BIN\0", 4), buffer);
  const auto read = testing::Read(glb);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->scene.meshes[0].positions[1], (Vec3f{1, 0, 0}));
}

}  // namespace
}  // namespace sheaf
