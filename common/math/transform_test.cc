// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/transform.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace sheaf {
namespace {

double LargestDifference(const Matrix4& a, const Matrix4& b) {
  double largest = 0;
  for (size_t r = 0; r < 4; ++r) {
    for (size_t c = 0; c < 4; ++c) largest = std::fmax(largest, std::fabs(a.m[r][c] - b.m[r][c]));
  }
  return largest;
}
void ExpectNear(Vec3d got, Vec3d want, double tolerance) {
  EXPECT_LE(Length(got - want), tolerance) << got.x << " " << got.y << " " << got.z << ", wanted "
                                           << want.x << " " << want.y << " " << want.z;
}

TEST(TransformTest, InvertsRandomMatrices) {
  std::mt19937_64 bits(3);
  std::uniform_real_distribution<double> element(-2, 2);
  for (int i = 0; i < 1000; ++i) {
    Matrix4 a, inverse;
    for (auto& row : a.m) {
      for (double& v : row) v = element(bits);
    }
    ASSERT_TRUE(Invert(a, &inverse));
    double largest = 0;
    for (const auto& row : inverse.m) {
      for (const double v : row) largest = std::fmax(largest, std::fabs(v));
    }
    EXPECT_LE(LargestDifference(a * inverse, Matrix4()), 1e-14 * (1 + largest));
  }
}

TEST(TransformTest, InvertsVeryDifferentScales) {
  // A nanometer model placed kilometers away is inverted to full precision, not taken as singular.
  const Matrix4 a = TranslateMatrix({1e6, -2e6, 3e6}) * ScaleMatrix({1e-9, 1e-9, 1e12});
  Matrix4 inverse;
  ASSERT_TRUE(Invert(a, &inverse));
  EXPECT_NEAR(inverse.m[0][0], 1e9, 1e-5);
  EXPECT_NEAR(inverse.m[2][2], 1e-12, 1e-27);
  ExpectNear(TransformPoint(inverse, {1e6, -2e6, 3e6}), {0, 0, 0}, 1e-9);
}

TEST(TransformTest, RefusesSingularAndNonFiniteMatrices) {
  const Matrix4 untouched = TranslateMatrix({1, 2, 3});
  Matrix4 inverse = untouched;
  EXPECT_FALSE(Invert(ScaleMatrix({1, 0, 1}), &inverse));
  Matrix4 dependent;
  dependent.m[0] = {1, 2, 3, 0};
  dependent.m[1] = {4, 5, 6, 0};
  dependent.m[2] = {7, 8, 9, 0};
  EXPECT_FALSE(Invert(dependent, &inverse));
  EXPECT_FALSE(Invert(ScaleMatrix({1, std::numeric_limits<double>::quiet_NaN(), 1}), &inverse));
  EXPECT_FALSE(Invert(ScaleMatrix({1, std::numeric_limits<double>::infinity(), 1}), &inverse));
  EXPECT_EQ(inverse, untouched);
}

TEST(TransformTest, RotationsByQuarterTurnsAreExact) {
  EXPECT_EQ(TransformVector(RotateMatrix(90, {0, 0, 1}), {1, 0, 0}), (Vec3d{0, 1, 0}));
  EXPECT_EQ(TransformVector(RotateMatrix(-90, {0, 0, 5}), {1, 0, 0}), (Vec3d{0, -1, 0}));
  EXPECT_EQ(TransformVector(RotateMatrix(180, {1, 0, 0}), {0, 1, 0}), (Vec3d{0, -1, 0}));
  EXPECT_EQ(TransformVector(RotateMatrix(3690, {0, 1, 0}), {0, 0, 1}), (Vec3d{1, 0, 0}));
  EXPECT_EQ(RotateMatrix(720, {0, 1, 0}), Matrix4());
}

TEST(TransformTest, RotationIsOrthonormalAboutAnyAxis) {
  const Matrix4 a = RotateMatrix(37.5, {1, -2, 3});
  EXPECT_LE(LargestDifference(a * Transpose(a), Matrix4()), 1e-15);
  EXPECT_NEAR(Determinant3(a), 1, 1e-15);
  ExpectNear(TransformVector(a, {1, -2, 3}), {1, -2, 3}, 1e-14);
}

TEST(TransformTest, LookAtIsLeftHandedAlongZ) {
  Matrix4 world_from_camera;
  ASSERT_TRUE(LookAtMatrix({1, 2, 3}, {1, 2, 13}, {0, 4, 0}, &world_from_camera));
  EXPECT_EQ(TransformPoint(world_from_camera, {0, 0, 0}), (Vec3d{1, 2, 3}));
  EXPECT_EQ(TransformVector(world_from_camera, {0, 0, 1}), (Vec3d{0, 0, 1}));
  EXPECT_EQ(TransformVector(world_from_camera, {0, 1, 0}), (Vec3d{0, 1, 0}));
  EXPECT_EQ(TransformVector(world_from_camera, {1, 0, 0}), (Vec3d{1, 0, 0}));
}

TEST(TransformTest, LookAtRefusesDegenerateDirections) {
  Matrix4 a;
  EXPECT_FALSE(LookAtMatrix({1, 2, 3}, {1, 2, 3}, {0, 1, 0}, &a));
  EXPECT_FALSE(LookAtMatrix({0, 0, 0}, {0, 5, 0}, {0, -1, 0}, &a));
  EXPECT_FALSE(LookAtMatrix({0, 0, 0}, {0.1, 0.7, 0.3}, {1, 7, 3}, &a));
  EXPECT_FALSE(LookAtMatrix({0, 0, 0}, {0, 0, 1}, {0, 0, 0}, &a));
}

TEST(TransformTest, NormalsStayPerpendicularUnderShear) {
  Matrix4 shear;
  shear.m[0][1] = 2;
  shear.m[1][2] = -0.5;
  Matrix4 inverse;
  ASSERT_TRUE(Invert(shear, &inverse));
  const Vec3d tangent{1, 2, 3}, normal{3, 0, -1};
  EXPECT_NEAR(Dot(TransformVector(shear, tangent), TransformNormal(inverse, normal)), 0, 1e-14);
}

TEST(TransformTest, ProjectivePointsAreDividedByW) {
  Matrix4 a;
  a.m[3] = {0, 0, 1, 0};
  EXPECT_EQ(TransformPoint(a, {2, 4, 2}), (Vec3d{1, 2, 1}));
}

TEST(TransformTest, DeterminantSignGivesHandedness) {
  EXPECT_EQ(Determinant3(ScaleMatrix({1, 1, -2})), -2);
  EXPECT_EQ(Determinant3(TranslateMatrix({1, 1, -2})), 1);
}

}  // namespace
}  // namespace sheaf
