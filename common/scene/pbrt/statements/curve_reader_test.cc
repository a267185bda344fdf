// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/statements/curve_reader.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "gtest/gtest.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

class CurveReaderTest : public ::testing::Test {
 protected:
  CurveReaderTest() { std::filesystem::create_directories(directory_); }
  ~CurveReaderTest() override { std::filesystem::remove_all(directory_); }

  absl::StatusOr<ReadSceneResult> Read(const std::string& world) {
    std::ofstream(directory_ + "/main.pbrt", std::ios::binary) << "WorldBegin\n" << world;
    DirectoryFileSource files(directory_);
    return ReadScene("main.pbrt", files);
  }
  // The only curves of the scene.
  CurveSet ReadOne(const std::string& shape) {
    absl::StatusOr<ReadSceneResult> result = Read(shape);
    EXPECT_TRUE(result.ok()) << result.status();
    if (!result.ok() || result->scene.curve_sets.size() != 1) return {};
    EXPECT_TRUE(result->diagnostics.empty());
    return result->scene.curve_sets[0];
  }
  // The reader's error about the shape.
  std::string Refusal(const std::string& shape) {
    return std::string(Read(shape).status().message());
  }

  const std::string directory_ = testing::TemporaryPath("curves");
};

TEST_F(CurveReaderTest, BezierSegmentsShareEndpoints) {
  const CurveSet curves = ReadOne(
      "Shape \"curve\" \"point3 P\" [0 0 0  1 0 0  2 1 0  3 1 0  4 1 0  5 2 0  6 2 0] "
      "\"float width0\" 4 \"float width1\" 2 \"string type\" \"cylinder\" \"integer splitdepth\" "
      "1");
  ASSERT_EQ(curves.size(), 2u);
  EXPECT_EQ(curves.kind, CurveSet::Kind::kCylinder);
  EXPECT_EQ(curves.points[3], (Vec3f{3, 1, 0}));
  EXPECT_EQ(curves.points[4], (Vec3f{3, 1, 0}));
  EXPECT_EQ(curves.points[7], (Vec3f{6, 2, 0}));
  EXPECT_EQ(curves.widths, (std::vector<float>{4, 3, 3, 2}));
}

// A parabola is the same in either degree: y = x^2 through quadratic control points (0,0) (1/2,0)
// (1,1).
TEST_F(CurveReaderTest, QuadraticsAreRaisedToCubics) {
  const CurveSet curves =
      ReadOne("Shape \"curve\" \"integer degree\" 2 \"point3 P\" [0 0 0  1.5 0 0  3 9 0]");
  ASSERT_EQ(curves.size(), 1u);
  EXPECT_EQ(curves.points, (std::vector<Vec3f>{{0, 0, 0}, {1, 0, 0}, {2, 3, 0}, {3, 9, 0}}));
  EXPECT_EQ(curves.widths, (std::vector<float>{1, 1}));
}

// Marsden's identity: with control points x = 0, 1, 2, ... a spline runs uniformly along x; and
// with their squares less a constant (1/3 in degree 3, 1/4 in degree 2), it runs along the
// parabola.
TEST_F(CurveReaderTest, SplinesReproduceLinesAndParabolas) {
  const CurveSet cubic = ReadOne(
      "Shape \"curve\" \"string basis\" \"bspline\" "
      "\"point3 P\" [0 0 0  3 9 0  6 36 0  9 81 0  12 144 0]");
  ASSERT_EQ(cubic.size(), 2u);
  EXPECT_EQ(cubic.points[3], cubic.points[4]);
  for (size_t i = 0; i < 4; ++i) EXPECT_FLOAT_EQ(cubic.points[i].x, 3 + static_cast<float>(i));
  EXPECT_FLOAT_EQ(cubic.points[0].y, 9 + 3);
  EXPECT_FLOAT_EQ(cubic.points[3].y, 36 + 3);
  const CurveSet quadratic = ReadOne(
      "Shape \"curve\" \"string basis\" \"bspline\" \"integer degree\" 2 "
      "\"point3 P\" [0 0 0  2 4 0  4 16 0]");
  ASSERT_EQ(quadratic.size(), 1u);
  EXPECT_FLOAT_EQ(quadratic.points[0].x, 1);
  EXPECT_FLOAT_EQ(quadratic.points[0].y, 1 + 1);
  EXPECT_FLOAT_EQ(quadratic.points[3].x, 3);
  EXPECT_FLOAT_EQ(quadratic.points[3].y, 9 + 1);
}

TEST_F(CurveReaderTest, RibbonsHaveUnitNormalsAtEachEnd) {
  const CurveSet curves = ReadOne(
      "Shape \"curve\" \"string type\" \"ribbon\" \"normal N\" [0 0 2  0 3 4] "
      "\"point3 P\" [0 0 0  1 0 0  2 0 0  3 0 0]");
  ASSERT_EQ(curves.normals.size(), 2u);
  EXPECT_EQ(curves.normals[0], (Vec3f{0, 0, 1}));
  EXPECT_EQ(curves.normals[1], (Vec3f{0, 0.6f, 0.8f}));
}

// Curves that differ only in their points become one shape; others do not.
TEST_F(CurveReaderTest, SimilarCurvesAreGrouped) {
  std::string world, other;
  for (int i = 0; i < 100; ++i) {
    const std::string points =
        "\"point3 P\" [0 0 0  1 0 0  2 0 0  3 0 " + std::to_string(i) + "]\n";
    world += i % 2 == 0 ? "NamedMaterial \"a\"\n" : "NamedMaterial \"b\"\n";
    world += "Shape \"curve\" " + points;
    other += "Translate 1 0 0\nShape \"curve\" " + points;
  }
  world =
      "MakeNamedMaterial \"a\" \"string type\" \"diffuse\"\n"
      "MakeNamedMaterial \"b\" \"string type\" \"diffuse\"\n" +
      world;
  absl::StatusOr<ReadSceneResult> result = Read(world);
  ASSERT_TRUE(result.ok()) << result.status();
  ASSERT_EQ(result->scene.shapes.size(), 2u);
  ASSERT_EQ(result->scene.curve_sets.size(), 2u);
  EXPECT_EQ(result->scene.world_shapes.size(), 2u);
  EXPECT_EQ(result->scene.curve_sets[0].size(), 50u);
  EXPECT_EQ(result->scene.curve_sets[1].points.back(), (Vec3f{3, 0, 99}));
  result = Read(other);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->scene.curve_sets.size(), 100u);
}

TEST_F(CurveReaderTest, InvalidCurvesAreRefused) {
  const std::string four = "\"point3 P\" [0 0 0  1 0 0  2 0 0  3 0 0] ";
  const struct {
    std::string shape, words;
  } cases[] = {
      {"\"point3 P\" [0 0 0  1 0 0]", "needs \"point3 P\", its control points: 4, and 3 for each"},
      {"\"point3 P\" [0 0 0  1 0 0  2 0 0  3 0 0  4 0 0]", "but has 5"},
      {"\"string basis\" \"bspline\" \"point3 P\" [0 0 0]", "4 or more for this basis"},
      {four + "\"string basis\" \"nurbs\"", "it must be bezier or bspline"},
      {four + "\"integer degree\" 4", "it must be 2 or 3"},
      {four + "\"string type\" \"tube\"", "it must be flat, cylinder or ribbon"},
      {four + "\"float width\" -1", "neither may be less than 0"},
      {four + "\"string type\" \"ribbon\"", "at each end of its segments: 2, but has 0"},
      {four + "\"string type\" \"ribbon\" \"normal N\" [0 0 1 0 0 0]", "no length at entry 1"},
  };
  for (const auto& c : cases) {
    const std::string said = Refusal("Shape \"curve\" " + c.shape + "\n");
    EXPECT_EQ(said.find("main.pbrt:2:"), 0u) << said;
    EXPECT_NE(said.find(c.words), std::string::npos) << said;
  }
  const std::string light = Refusal("AreaLightSource \"diffuse\"\nShape \"curve\" " + four + "\n");
  EXPECT_EQ(light.find("main.pbrt:3:1: shape \"curve\": curves cannot be area lights"), 0u)
      << light;
}

}  // namespace
}  // namespace sheaf
