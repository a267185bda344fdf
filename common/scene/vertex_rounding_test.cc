// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/vertex_rounding.h"

#include <cmath>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/hard_case.h"

namespace sheaf {
namespace {

// A square of 3 x 3 vertices, `spacing` apart, about `at`.
std::vector<Vec3d> Grid(Vec3d at, double spacing) {
  std::vector<Vec3d> points;
  for (int y = -1; y <= 1; ++y) {
    for (int x = -1; x <= 1; ++x) points.push_back(at + Vec3d{x * spacing, y * spacing, 0});
  }
  return points;
}
const std::vector<uint32_t> kGridIndices = {0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4,
                                            3, 4, 7, 3, 7, 6, 4, 5, 8, 4, 8, 7};

std::vector<Vec3f> Rounded(const std::vector<Vec3d>& points, Vec3d* origin) {
  VertexRounding vertices;
  for (const Vec3d& p : points) vertices.Add(p);
  return vertices.Take(origin);
}

TEST(VertexRoundingTest, G22FarVerticesAreRoundedAboutTheirMiddle) {
  for (const double spacing : {1e-2, 1.0, 1e3}) {
    const std::vector<Vec3d> points = Grid({500000.1, 5400000.3, 12.7}, spacing);
    Vec3d origin;
    const std::vector<Vec3f> rounded = Rounded(points, &origin);
    double largest = 0, naive = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      largest = std::fmax(largest, Length(ToDouble(rounded[i]) + origin - points[i]));
      naive = std::fmax(naive, Length(ToDouble(ToFloat(points[i])) - points[i]));
    }
    ExpectHardCase(
        {.row = "G22",
         .figure = "error of vertices on a map, in parts of their distance of " + InWords(spacing),
         .expected = 0,
         .measured = largest / spacing,
         .tolerance = 1e-6,
         .naive = naive / spacing,
         .naive_by = "vertices rounded to float"});
    EXPECT_FALSE(WhyImprecise(rounded, kGridIndices, 3).has_value());
  }
}

TEST(VertexRoundingTest, OthersStayAsTheyAre) {
  const std::vector<Vec3d> near = Grid({0.1, 0.2, 0.3}, 0.7), far = Grid({8.5e6, 0, 1}, 4);
  for (const std::vector<Vec3d>& points : {near, far}) {  // Those of `far` are floats.
    Vec3d origin;
    const std::vector<Vec3f> rounded = Rounded(points, &origin);
    EXPECT_EQ(origin, Vec3d{});
    for (size_t i = 0; i < points.size(); ++i) EXPECT_EQ(rounded[i], ToFloat(points[i]));
  }
}

TEST(VertexRoundingTest, G22VerticesThatFloatCannotTellApartAreNoticed) {
  const auto floats = [](Vec3d at, double spacing) {
    std::vector<Vec3f> points;
    for (const Vec3d& p : Grid(at, spacing)) points.push_back(ToFloat(p));
    return points;
  };
  const Vec3d map{500000, 5400000, 0};
  const auto why = WhyImprecise(floats(map, 0.5), kGridIndices, 3);
  ASSERT_TRUE(why.has_value());
  EXPECT_NE(why->find("neighboring vertices"), std::string::npos) << *why;
  EXPECT_FALSE(WhyImprecise(floats(map, 100), kGridIndices, 3).has_value());
  EXPECT_FALSE(WhyImprecise(floats({}, 1e-9), kGridIndices, 3).has_value());
}

TEST(VertexRoundingTest, MotionCarriesTheOriginAlongUnlessItTurns) {
  const Vec3d origin{500000, 5400000, 0}, p{0.25, -0.5, 0.125};
  TransformOverTime moves;
  moves.start = RotateMatrix(30, {1, 2, 3});
  moves.end = TranslateMatrix({0, 0, 2}) * moves.start;
  ASSERT_TRUE(CanMoveOrigin(moves));
  TransformOverTime moved = moves;
  MoveOrigin(origin, &moved);
  EXPECT_LT(Length(TransformPoint(moved.start, p) - TransformPoint(moves.start, origin + p)), 1e-8);
  EXPECT_LT(Length(TransformPoint(moved.end, p) - TransformPoint(moves.end, origin + p)), 1e-8);
  moves.end = RotateMatrix(40, {1, 2, 3});
  EXPECT_FALSE(CanMoveOrigin(moves));
}

}  // namespace
}  // namespace sheaf
