// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampling/equal_area_map.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

TEST(EqualAreaMapTest, LandmarksMatchPbrt) {
  const struct {
    Vec2d st;
    Vec3d d;
  } landmarks[] = {{{0.5, 0.5}, {0, 0, 1}}, {{1, 0.5}, {1, 0, 0}},  {{0, 0.5}, {-1, 0, 0}},
                   {{0.5, 1}, {0, 1, 0}},   {{0.5, 0}, {0, -1, 0}}, {{0, 0}, {0, 0, -1}},
                   {{1, 0}, {0, 0, -1}},    {{0, 1}, {0, 0, -1}},   {{1, 1}, {0, 0, -1}}};
  for (const auto& landmark : landmarks) {
    EXPECT_LT(Length(EqualAreaSquareToSphere(landmark.st) - landmark.d), 1e-7);
  }
}

TEST(EqualAreaMapTest, SquareToSphereRoundTrips) {
  constexpr int kSide = 257;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const Vec2d st{(x + 0.5) / kSide, (y + 0.5) / kSide};
      const Vec3d d = EqualAreaSquareToSphere(st);
      ASSERT_NEAR(Length(d), 1, 1e-9);
      const Vec2f back = EqualAreaSphereToSquare(ToFloat(d));
      ASSERT_NEAR(static_cast<double>(back.x), st.x, 3e-7);
      ASSERT_NEAR(static_cast<double>(back.y), st.y, 3e-7);
    }
  }
}

// The solid angle of a small parallelogram of the map is 4 pi times its area everywhere.
TEST(EqualAreaMapTest, AreasAreEqual) {
  constexpr int kSide = 64;
  constexpr double kStep = 1e-4;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const Vec2d st{(x + 0.37) / kSide, (y + 0.41) / kSide};
      const auto at = [&](double ds, double dt) {
        return EqualAreaSquareToSphere({st.x + ds * kStep, st.y + dt * kStep});
      };
      const Vec3d along_s = at(1, 0) - at(-1, 0), along_t = at(0, 1) - at(0, -1);
      const double area = Length(Cross(along_s, along_t)) / (4 * kStep * kStep);
      ASSERT_NEAR(area / (4 * kPi), 1, 2e-3) << st.x << ' ' << st.y;
    }
  }
}

TEST(EqualAreaMapTest, EveryDirectionHasAPoint) {
  for (const Vec3f& d : {Vec3f{0, 0, 1}, Vec3f{0, 0, -1}, Vec3f{1, 0, 0}, Vec3f{0, -1, 0},
                         Vec3f{1e-30f, 0, 1}, Vec3f{-0.f, -0.f, -1}, Vec3f{0.6f, 0, 0.8f}}) {
    const Vec2f st = EqualAreaSphereToSquare(d);
    EXPECT_TRUE(st.x >= 0 && st.x <= 1 && st.y >= 0 && st.y <= 1);
    EXPECT_LT(
        Length(EqualAreaSquareToSphere({static_cast<double>(st.x), static_cast<double>(st.y)}) -
               ToDouble(d)),
        2e-6);
  }
}

}  // namespace
}  // namespace sheaf::render
