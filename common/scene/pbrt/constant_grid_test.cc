// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests which grids of one value become homogeneous media, and which stay grids.
#include "common/scene/pbrt/constant_grid.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/scene/pbrt/scene_reader.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

using ::testing::StartsWith;

// The centers of its outermost cells span -1 to 1.
constexpr char kGrid[] =
    "MakeNamedMedium \"smoke\" \"string type\" \"uniformgrid\" \"point3 p0\" [-2 -2 -2]\n"
    "  \"point3 p1\" [2 2 2] \"integer nx\" 2 \"integer ny\" 2 \"integer nz\" 2\n"
    "  \"rgb sigma_a\" [1 2 3] \"rgb sigma_s\" [4 5 6] \"float g\" 0.5 \"float scale\" 3\n";
constexpr char kEven[] = "  \"float density\" [2 2 2 2 2 2 2 2]\n";
constexpr char kCube[] =
    "Shape \"trianglemesh\" \"integer indices\" [0 2 3 0 3 1 4 5 7 4 7 6 0 1 5 0 5 4\n"
    "  2 6 7 2 7 3 0 4 6 0 6 2 1 3 7 1 7 5]\n"
    "  \"point3 P\" [-1 -1 -1  1 -1 -1  -1 1 -1  1 1 -1  -1 -1 1  1 -1 1  -1 1 1  1 1 1]";

class ConstantGridTest : public ::testing::Test {
 protected:
  // The scene of a camera, the medium and `world`, which is within the medium's boundary.
  SceneDescription Read(const std::string& medium, const std::string& world,
                        const std::string& options = "") {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    const std::string folder = ::testing::TempDir() + "sheaf-constant-" + info->name();
    EXPECT_TRUE(MakeDirectories(folder).ok());
    const std::string text =
        absl::StrCat(options, "Camera \"perspective\"\nWorldBegin\n", medium,
                     "Material \"interface\"\nMediumInterface \"smoke\" \"\"\n", world, "\n");
    EXPECT_TRUE(WriteFileAtomically(folder + "/main.pbrt", text).ok());
    DirectoryFileSource files(folder);
    absl::StatusOr<ReadSceneResult> result = ReadScene("main.pbrt", files);
    EXPECT_TRUE(result.ok()) << result.status().message();
    if (!result.ok()) return {};
    for (const SceneDiagnostic& diagnostic : result->diagnostics) {
      // The only remark about these scenes: how pbrt-v4 reads the emission of rgbgrid.
      EXPECT_NE(diagnostic.text.find("\"Le\" is a radiance"), std::string::npos) << diagnostic.text;
    }
    return std::move(result->scene);
  }
  void ExpectTaken(const std::string& medium, const std::string& world) {
    const SceneDescription scene = Read(medium, world);
    ASSERT_FALSE(scene.media.empty());
    EXPECT_TRUE(scene.media[0].IsHomogeneous());
    EXPECT_EQ(scene.media[0].constant_grid, "constant grid: treated as homogeneous");
  }
  void ExpectLeft(const std::string& medium, const std::string& world, const std::string& why,
                  const std::string& options = "") {
    const SceneDescription scene = Read(medium, world, options);
    ASSERT_FALSE(scene.media.empty());
    EXPECT_FALSE(scene.media[0].IsHomogeneous()) << world;
    EXPECT_THAT(scene.media[0].constant_grid,
                StartsWith(why.empty() ? "" : "constant grid: stays a grid, because " + why));
    EXPECT_EQ(scene.media[0].constant_grid.empty(), why.empty());
  }
  const std::string even_ = absl::StrCat(kGrid, kEven);
};

TEST_F(ConstantGridTest, InsideItsOutermostValuesItIsHomogeneous) {
  ExpectTaken(even_, kCube);
  ExpectTaken(even_, "Shape \"sphere\" \"float radius\" 1");
  ExpectTaken(even_, "Translate 0.25 0 0\nRotate 30 1 2 3\nShape \"sphere\" \"float radius\" 0.75");
  ExpectTaken(even_, absl::StrCat("Rotate 45 0 0 1\nScale 0.7 -0.7 1\n", kCube));
  // The grid's transform decides, not the world's axes.
  ExpectTaken(
      absl::StrCat("AttributeBegin Translate 50 0 0 Rotate 45 0 0 1\n", even_, "AttributeEnd\n"),
      absl::StrCat("Translate 50 0 0\nRotate 45 0 0 1\n", kCube));
  ExpectTaken(even_, absl::StrCat("ObjectBegin \"o\"\nScale 0.5 0.5 0.5\n", kCube,
                                  "\nObjectEnd\nTranslate 0.5 0.5 0\nObjectInstance \"o\""));
}

TEST_F(ConstantGridTest, CoefficientsAreKept) {
  const SceneDescription scene = Read(even_, kCube);
  EXPECT_EQ(scene.media[0].sigma_a.rgb, (Rgb{1, 2, 3}));
  EXPECT_EQ(scene.media[0].sigma_s.rgb, (Rgb{4, 5, 6}));
  EXPECT_EQ(scene.media[0].scale, 6);
  EXPECT_EQ(scene.media[0].g, 0.5f);
  const SceneDescription emissive = Read(
      absl::StrCat(even_, "  \"rgb Le\" [1 1 1] \"float Lescale\" [3 3 3 3 3 3 3 3]\n"), kCube);
  EXPECT_TRUE(emissive.media[0].IsHomogeneous());
  EXPECT_TRUE(emissive.media[0].emits);
  EXPECT_EQ(emissive.media[0].radiance_scale, 3);
}

TEST_F(ConstantGridTest, ConstantColorGridsAreHomogeneous) {
  const std::string grid =
      "MakeNamedMedium \"smoke\" \"string type\" \"rgbgrid\" \"point3 p0\" [-3 -2 -2]\n"
      "  \"point3 p1\" [3 2 2] \"integer nx\" 2 \"integer ny\" 1 \"integer nz\" 1\n";
  // A grid one cell across has its value only in the middle.
  ExpectLeft(absl::StrCat(grid, "  \"rgb sigma_s\" [1 2 3 1 2 3]\n"), kCube,
             "the shape at main.pbrt:8:1 reaches beyond");
  const std::string fine =
      "MakeNamedMedium \"smoke\" \"string type\" \"rgbgrid\" \"point3 p0\" [-2 -2 -2]\n"
      "  \"point3 p1\" [2 2 2] \"integer nx\" 2 \"integer ny\" 2 \"integer nz\" 2\n";
  std::string cells;
  for (int i = 0; i < 8; ++i) cells += " 0.5 1 2";
  const std::string even = absl::StrCat(fine, "  \"rgb sigma_s\" [", cells, "]\n");
  ExpectTaken(even, kCube);
  const SceneDescription scene = Read(even, kCube);
  EXPECT_EQ(scene.media[0].sigma_s.rgb, (Rgb{0.5f, 1, 2}));
  EXPECT_EQ(scene.media[0].sigma_a.rgb, Rgb::Gray(1));
  ExpectLeft(absl::StrCat(even, "  \"rgb sigma_a\" [", cells, "] \"rgb Le\" [", cells, "]\n"),
             kCube, "");
}

TEST_F(ConstantGridTest, ShapesReachingOutsideKeepTheGrid) {
  const std::string why = "the shape at main.pbrt:10:1 reaches beyond the outermost values";
  ExpectLeft(even_, absl::StrCat("Scale 1.0001 1 1\n", kCube), why);
  ExpectLeft(even_, "Translate 0 0.1 0\nShape \"sphere\" \"float radius\" 0.95", why);
  ExpectLeft(even_, absl::StrCat("Rotate 45 0 0 1\n", kCube), why);
  // A second shape of the same medium, and a second instance of the same shape.
  ExpectLeft(even_, absl::StrCat(kCube, "\nShape \"sphere\" \"float radius\" 1.5"),
             "the shape at main.pbrt:12:1 reaches beyond");
  ExpectLeft(even_,
             absl::StrCat("ObjectBegin \"o\"\n", kCube, "\nObjectEnd\nObjectInstance \"o\"\n",
                          "Translate 0 0 1\nObjectInstance \"o\""),
             why);
}

TEST_F(ConstantGridTest, UnboundedMediaKeepTheGrid) {
  const std::string shape = "the shape at main.pbrt:";
  ExpectLeft(even_, "Shape \"disk\"", shape + "9:1 is not known to enclose it");
  ExpectLeft(even_, "Shape \"sphere\" \"float phimax\" 200", shape + "9:1 is not known");
  ExpectLeft(even_, absl::StrCat("ReverseOrientation\n", kCube), shape + "10:1 is not known");
  ExpectLeft(even_, "ReverseOrientation\nShape \"sphere\"", shape + "10:1 is not known");
  ExpectLeft(even_,
             "Shape \"trianglemesh\" \"integer indices\" [0 1 2]\n"
             "  \"point3 P\" [0 0 0 1 0 0 0 1 0]",
             shape + "9:1 is not known");
  ExpectLeft(even_, absl::StrCat("MediumInterface \"\" \"smoke\"\n", kCube),
             shape + "10:1 has it outside");
  ExpectLeft(even_, "MediumInterface \"\"\nShape \"sphere\"", "no shape has it inside");
  ExpectLeft(even_, kCube, "the camera is in it", "MediumInterface \"\" \"smoke\"\n");
}

TEST_F(ConstantGridTest, NormalsDecideTheInside) {
  const auto with_normals = [](float sign) {
    std::string normals;
    for (int i = 0; i < 8; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        absl::StrAppend(&normals, " ", (i >> axis & 1) != 0 ? sign : -sign);
      }
    }
    return absl::StrCat(kCube, " \"normal N\" [", normals, "]");
  };
  ExpectTaken(even_, with_normals(1));
  ExpectLeft(even_, with_normals(-1), "the shape at main.pbrt:9:1 is not known to enclose it");
  ExpectTaken(even_, "ReverseOrientation\n" + with_normals(-1));
}

TEST_F(ConstantGridTest, MovingMediaKeepTheGrid) {
  ExpectLeft(even_,
             absl::StrCat("ActiveTransform EndTime Translate 0.1 0 0 ActiveTransform All\n",
                          "Scale 0.5 0.5 0.5\n", kCube),
             "the shape at main.pbrt:11:1 moves");
  std::string velocities = "  \"vector3 velocity\" [1 0 0";
  for (int i = 1; i < 8; ++i) velocities += " 0 0 0";
  ExpectLeft(absl::StrCat(even_, velocities, "]\n"), absl::StrCat("Scale 0.5 0.5 0.5\n", kCube),
             "it moves by velocities");
}

TEST_F(ConstantGridTest, VaryingGridsAreNotExamined) {
  ExpectLeft(absl::StrCat(kGrid, "  \"float density\" [2 2 2 2 2 2 2 2.0001]\n"), kCube, "");
  ExpectLeft(absl::StrCat(even_, "  \"float temperature\" [900 900 900 900 900 900 900 900]\n"),
             kCube, "");
  ExpectLeft(absl::StrCat(even_, "  \"rgb Le\" [1 1 1] \"float Lescale\" [1 1 1 1 1 1 1 2]\n"),
             kCube, "");
}

}  // namespace
}  // namespace sheaf
