// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/geometry/needle.h"

#include <cmath>
#include <limits>

#include "gtest/gtest.h"

namespace sheaf::render {
namespace {

const std::array<Vec3d, 3> kCorner{{{0, 0, 1}, {1, 0, 1}, {0, 1, 1}}};
constexpr Vec3d kOrigin{0, 0, 0};

TEST(NeedleTest, SlimmestTriangleDecidesTheMesh) {
  const auto holds = [](float height) {
    return HasNeedles({{0, 0, 0}, {1, 0, 0}, {0.5f, 1, 0}, {0.3f, height, 0}}, {0, 1, 2, 0, 1, 3});
  };
  EXPECT_FALSE(holds(1.0f / 127));
  EXPECT_TRUE(holds(1.0f / 129));
  EXPECT_FALSE(HasNeedles({}, {}));
}

TEST(NeedleTest, BarycentricsAndDistanceAgree) {
  const Vec3d d{0.25, 0.5, 2};
  const auto hit = IntersectTriangle(kOrigin, d, kCorner);
  ASSERT_TRUE(hit.has_value());
  EXPECT_DOUBLE_EQ(hit->t, 0.5);
  EXPECT_DOUBLE_EQ(hit->u, 0.125);
  EXPECT_DOUBLE_EQ(hit->v, 0.25);
  // From behind, too.
  const auto back = IntersectTriangle(d, -d, kCorner);
  ASSERT_TRUE(back.has_value());
  EXPECT_DOUBLE_EQ(back->u, 0.125);
}

TEST(NeedleTest, TrianglesBehindOrBesideAreNotHit) {
  EXPECT_FALSE(IntersectTriangle(kOrigin, {-0.25, -0.5, -2}, kCorner).has_value());
  EXPECT_FALSE(IntersectTriangle(kOrigin, {-1e-5, 0.5, 1}, kCorner).has_value());
  EXPECT_FALSE(IntersectTriangle(kOrigin, {0.6, 0.6, 1}, kCorner).has_value());
}

TEST(NeedleTest, RaysWithinRoundingHitTheEdge) {
  const auto hit = IntersectTriangle(kOrigin, {-1e-7, 0.5, 1}, kCorner);
  ASSERT_TRUE(hit.has_value());
  EXPECT_EQ(hit->u, 0);
  EXPECT_NEAR(hit->v, 0.5, 1e-12);
  EXPECT_NEAR(hit->t, 1, 1e-7);
}

TEST(NeedleTest, RaysInThePlaneHitAnEdgeOrMiss) {
  const auto through = IntersectTriangle({-1, 0.25, 1}, {1, 0, 0}, kCorner);
  ASSERT_TRUE(through.has_value());
  EXPECT_TRUE(std::isfinite(through->t) && through->t >= 1 && through->t <= 1.75);
  EXPECT_FALSE(IntersectTriangle({-1, 1.25, 1}, {1, 0, 0}, kCorner).has_value());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(IntersectTriangle({nan, 0, 0}, {1, 0, 0}, kCorner).has_value());
}

}  // namespace
}  // namespace sheaf::render
