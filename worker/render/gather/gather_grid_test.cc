// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/gather/gather_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <utility>
#include <vector>

namespace sheaf::render {
namespace {

// Balls on a wavy sheet, with radii over three orders of magnitude.
std::vector<GatherBall> BallsOnSheet(int count, float scale) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<GatherBall> balls;
  for (int i = 0; i < count; ++i) {
    const float x = 4 * unit(random) - 2, z = 4 * unit(random) - 2;
    const float radius = 0.001f * std::exp2(10 * unit(random));
    balls.push_back({Vec3f{x, 0.2f * x * z, z} * scale, radius * scale});
  }
  return balls;
}

using Found = std::vector<std::pair<uint32_t, float>>;

Found FoundBy(const GatherGrid& grid, Vec3f p) {
  Found found;
  grid.ForEachAround(p, [&](uint32_t ball, float square) { found.emplace_back(ball, square); });
  return found;
}

std::vector<Vec3f> PlacesNear(const std::vector<GatherBall>& balls, int count, float scale) {
  std::mt19937 random(8);
  std::uniform_real_distribution<float> unit(-1, 1);
  std::vector<Vec3f> places;
  for (int i = 0; i < count; ++i) {
    const GatherBall& ball = balls[random() % balls.size()];
    const Vec3f offset{unit(random), unit(random), unit(random)};
    places.push_back(ball.p + offset * (i % 3 == 0 ? scale : ball.radius));
  }
  return places;
}

TEST(GatherGridTest, FindsExactlyTheBallsThatContainThePlace) {
  const std::vector<GatherBall> balls = BallsOnSheet(3'000, 1);
  GatherGrid grid;
  grid.Build(balls);
  size_t total = 0;
  for (const Vec3f& p : PlacesNear(balls, 2'000, 1)) {
    Found expected;
    for (uint32_t i = 0; i < balls.size(); ++i) {
      const Vec3f d = p - balls[i].p;
      if (Dot(d, d) < balls[i].radius * balls[i].radius) expected.emplace_back(i, Dot(d, d));
    }
    Found found = FoundBy(grid, p);
    std::ranges::sort(found);
    EXPECT_EQ(found, expected);
    total += found.size();
  }
  EXPECT_GT(total, 10'000u);
}

TEST(GatherGridTest, FindsTheSameInASceneOfAnotherScale) {
  GatherGrid grid;
  const std::vector<GatherBall> balls = BallsOnSheet(1'000, 1);
  grid.Build(balls);
  for (const float scale : {0x1p-20f, 0x1p20f}) {
    GatherGrid scaled;
    scaled.Build(BallsOnSheet(1'000, scale));
    for (const Vec3f& p : PlacesNear(balls, 500, 1)) {
      Found found = FoundBy(grid, p), again = FoundBy(scaled, p * scale);
      std::ranges::sort(found);
      std::ranges::sort(again);
      ASSERT_EQ(found.size(), again.size());
      for (size_t i = 0; i < found.size(); ++i) {
        EXPECT_EQ(found[i].first, again[i].first);
        EXPECT_EQ(found[i].second * scale * scale, again[i].second);
      }
    }
  }
}

TEST(GatherGridTest, IsEmptyUntilBuiltAndIsBuiltAgain) {
  GatherGrid grid;
  EXPECT_TRUE(FoundBy(grid, {}).empty());
  grid.Build({});
  EXPECT_TRUE(FoundBy(grid, {}).empty());
  grid.Build(std::vector<GatherBall>{{{0, 0, 0}, 1}, {{0.5f, 0, 0}, 1}});
  EXPECT_EQ(FoundBy(grid, {}), (Found{{0, 0.0f}, {1, 0.25f}}));
  grid.Build(std::vector<GatherBall>{{{9, 0, 0}, 1}});
  EXPECT_TRUE(FoundBy(grid, {}).empty());
  EXPECT_EQ(FoundBy(grid, {9, 0, 0}), (Found{{0, 0.0f}}));
}

TEST(GatherGridTest, IgnoresBallsWithoutAPlaceOrSize) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  GatherGrid grid;
  grid.Build(std::vector<GatherBall>{{{kNan, 0, 0}, 1},
                                     {{0, kInf, 0}, 1},
                                     {{0, 0, 0}, kNan},
                                     {{0, 0, 0}, kInf},
                                     {{0, 0, 0}, 0},
                                     {{0, 0, 0}, -1},
                                     {{0, 0, 0}, 1},
                                     {{3e38f, 0, 0}, 1e-30f}});
  EXPECT_EQ(FoundBy(grid, {}), (Found{{6, 0.0f}}));
  EXPECT_TRUE(FoundBy(grid, {kNan, 0, 0}).empty());
  EXPECT_TRUE(FoundBy(grid, {kInf, kInf, kInf}).empty());
}

}  // namespace
}  // namespace sheaf::render
