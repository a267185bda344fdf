// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the parameters of meshes that are displaced or deform.
#include "common/scene/pbrt/statements/mesh_parameters.h"

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <variant>
#include <vector>

#include "common/base/file.h"
#include "common/scene/pbrt/scene_reader.h"

namespace sheaf {
namespace {

class MeshParametersTest : public ::testing::Test {
 protected:
  MeshParametersTest() { EXPECT_TRUE(MakeDirectories(directory_).ok()); }

  void Write(const std::string& name, const std::string& text) {
    std::ofstream(directory_ + "/" + name, std::ios::binary) << text;
  }
  SceneDescription ReadGood(const std::string& text) {
    Write("main.pbrt", text);
    DirectoryFileSource files(directory_);
    absl::StatusOr<ReadSceneResult> result = ReadScene("main.pbrt", files);
    EXPECT_TRUE(result.ok()) << result.status();
    if (!result.ok()) return {};
    notes_ = result->diagnostics;
    return result->scene;
  }

  const std::string directory_ = ::testing::TempDir() + "sheaf-mesh-parameters";
  std::vector<SceneDiagnostic> notes_;
};

TEST_F(MeshParametersTest, ReadsDisplacement) {
  const SceneDescription scene = ReadGood(
      "Option \"float displacementedgescale\" 4\nWorldBegin\n"
      "Texture \"h\" \"float\" \"constant\" \"float value\" 0.5\n"
      "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"texture displacement\" \"h\"\n"
      "  \"float displacement.edgelength\" 0.25\n"
      "Shape \"loopsubdiv\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"texture displacement\" \"h\"\n"
      "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"float edgelength\" 3\n");
  const auto& first = std::get<MeshShape>(scene.shapes.at(0).shape);
  EXPECT_NE(first.displacement.texture, kNone);
  EXPECT_EQ(first.edge_length, 1);
  EXPECT_EQ(std::get<MeshShape>(scene.shapes.at(1).shape).edge_length, 4);
  EXPECT_FALSE(std::get<MeshShape>(scene.shapes.at(2).shape).IsDisplaced());
  ASSERT_FALSE(notes_.empty());
  EXPECT_NE(notes_[0].text.find("parameter \"edgelength\" has no effect"), std::string::npos);
}

TEST_F(MeshParametersTest, ReadsVertexSteps) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  Write("a.ply", header + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  Write("b.ply", header + "0 0 1\n1 0 1\n0 1 1\n3 0 1 2\n");
  const SceneDescription scene = ReadGood(
      "WorldBegin\n"
      "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"point3 P1\" [0 0 0 1 0 0 0 1 1]\n"
      "  \"point3 P2\" [0 0 0 1 0 0 0 1 2] \"normal N\" [0 0 1 0 0 1 0 0 1]\n"
      "  \"normal N1\" [0 1 1 0 0 1 0 0 1] \"normal N2\" [0 0 1 0 0 1 0 0 1]\n"
      "Shape \"plymesh\" \"string filename\" \"a.ply\" \"string filename1\" \"b.ply\"\n"
      "Shape \"plymesh\" \"string filename\" \"a.ply\"\n"
      "Shape \"plymesh\" \"string filename\" \"a.ply\" \"string filename1\" \"a.ply\"\n");
  ASSERT_EQ(scene.meshes.size(), 4u);
  ASSERT_EQ(scene.meshes[0].steps.size(), 2u);
  EXPECT_EQ(scene.meshes[0].steps[1].positions.at(2), (Vec3f{0, 1, 2}));
  EXPECT_EQ(scene.meshes[0].steps[0].normals.at(0), (Vec3f{0, 1, 1}));
  ASSERT_EQ(scene.meshes[1].steps.size(), 1u);
  EXPECT_EQ(scene.meshes[1].steps[0].positions.at(0), (Vec3f{0, 0, 1}));
  EXPECT_TRUE(scene.meshes[2].steps.empty());
  EXPECT_TRUE(scene.meshes[3].steps.empty());  // Nothing moves.
}

}  // namespace
}  // namespace sheaf
