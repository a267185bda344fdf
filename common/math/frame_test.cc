// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/frame.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace sheaf {
namespace {

void ExpectOrthonormal(const Frame& frame) {
  constexpr double kTolerance = 5e-7;  // A unit normal in float itself has an error of 1e-7.
  EXPECT_NEAR(Length(frame.t), 1, kTolerance);
  EXPECT_NEAR(Length(frame.b), 1, kTolerance);
  EXPECT_NEAR(Dot(frame.t, frame.b), 0, kTolerance);
  EXPECT_NEAR(Dot(frame.t, frame.n), 0, kTolerance);
  EXPECT_NEAR(Dot(frame.b, frame.n), 0, kTolerance);
  EXPECT_NEAR(Length(Cross(frame.t, frame.b) - frame.n), 0, kTolerance);
}

TEST(FrameTest, IsOrthonormalForRandomAndPolarNormals) {
  std::mt19937 bits(5);
  std::normal_distribution<float> component;
  for (int i = 0; i < 20000; ++i) {
    ExpectOrthonormal(
        Frame::FromNormal(Normalize(Vec3f{component(bits), component(bits), component(bits)})));
  }
  // The poles and their surroundings, where earlier constructions lose digits.
  for (const float z : {1.0f, -1.0f, 0.0f, -0.0f})
    ExpectOrthonormal(Frame::FromNormal(z == 0 ? Vec3f{1, 0, z} : Vec3f{0, 0, z}));
  for (float tilt = 1e-1f; tilt > 1e-10f; tilt *= 0.1f) {
    ExpectOrthonormal(Frame::FromNormal(Normalize(Vec3f{tilt, -tilt, -1})));
    ExpectOrthonormal(Frame::FromNormal(Normalize(Vec3f{1, tilt, -tilt})));
  }
}

TEST(FrameTest, LocalAndWorldTransformsAreInverse) {
  const Frame frame = Frame::FromNormal(Normalize(Vec3f{1, -2, -3}));
  const Vec3f v{0.3f, -0.7f, 0.2f};
  EXPECT_LE(Length(frame.ToWorld(frame.ToLocal(v)) - v), 2e-7f);
  EXPECT_EQ(frame.ToWorld({0, 0, 1}), frame.n);
}

}  // namespace
}  // namespace sheaf
