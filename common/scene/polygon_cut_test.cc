// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/polygon_cut.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <utility>

#include "tests/support/exact.h"

namespace sheaf {
namespace {

int ExactOrientation(Vec2f a, Vec2f b, Vec2f c) {
  const auto exact = [](float x) { return Exact(static_cast<double>(x)); };
  return ((exact(a.x) - exact(c.x)) * (exact(b.y) - exact(c.y)) -
          (exact(a.y) - exact(c.y)) * (exact(b.x) - exact(c.x)))
      .Sign();
}

std::vector<uint32_t> AllCorners(size_t count) {
  std::vector<uint32_t> corners(count);
  std::iota(corners.begin(), corners.end(), 0u);
  return corners;
}

PolygonCutter::Result Cut(const std::vector<Vec3f>& polygon, std::vector<uint32_t>* triangles) {
  triangles->assign(3 * (polygon.size() - 2), 99999);
  return PolygonCutter().Cut(polygon, AllCorners(polygon.size()), triangles->data());
}

// Triangles that all turn left, and whose edges cancel except for those of the polygon, cover each
// point as often as the polygon winds around it: its inside once.
void ExpectCovers(const std::vector<Vec3f>& polygon) {
  std::vector<uint32_t> triangles;
  ASSERT_EQ(Cut(polygon, &triangles), PolygonCutter::Result::kCut);
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (size_t i = 0; i < triangles.size(); i += 3) {
    const uint32_t* t = &triangles[i];
    for (size_t k = 0; k < 3; ++k) {
      ASSERT_LT(t[k], polygon.size());
      ++edges[{t[k], t[(k + 1) % 3]}];
      --edges[{t[(k + 1) % 3], t[k]}];
    }
    const Vec3f a = polygon[t[0]], b = polygon[t[1]], c = polygon[t[2]];
    EXPECT_GE(ExactOrientation({a.x, a.y}, {b.x, b.y}, {c.x, c.y}), 0) << "triangle " << i / 3;
  }
  const auto count = static_cast<uint32_t>(polygon.size());
  for (const auto& [edge, times] : edges) {
    const int expected = edge.second == (edge.first + 1) % count   ? 1
                         : edge.first == (edge.second + 1) % count ? -1
                                                                   : 0;
    EXPECT_EQ(times, expected) << edge.first << " to " << edge.second;
  }
}

TEST(PolygonCutTest, OrientationIsExact) {
  std::mt19937 random(5);
  // Steps of the last bit about a line through the three, where plain arithmetic guesses.
  std::uniform_int_distribution<int> steps(-3, 3);
  const auto near = [&](float x) {
    return std::nextafterf(x, x + static_cast<float>(steps(random)));
  };
  int zeros = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec2f a{near(12), near(12)}, b{near(24), near(24)}, c{near(0.5f), near(0.5f)};
    const int expected = ExactOrientation(a, b, c);
    zeros += expected == 0 ? 1 : 0;
    ASSERT_EQ(Orientation(a, b, c), expected);
  }
  EXPECT_GT(zeros, 100);
  EXPECT_EQ(Orientation({0, 0}, {3e38f, 1e-45f}, {-3e38f, 1e-45f}), 1);
  EXPECT_EQ(Orientation({1e-45f, 0}, {0, 1e-45f}, {0, 0}), 1);
}

TEST(PolygonCutTest, ConvexPolygonsAreFans) {
  std::vector<Vec3f> polygon;
  for (int i = 0; i < 12; ++i) {
    const double angle = 0.5 * i;
    polygon.push_back(
        {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)), 1});
  }
  polygon.push_back((polygon.front() + polygon.back()) * 0.5f);
  std::vector<uint32_t> triangles;
  ASSERT_EQ(Cut(polygon, &triangles), PolygonCutter::Result::kCut);
  for (uint32_t i = 2; i < polygon.size(); ++i) {
    EXPECT_EQ(triangles[3 * i - 6], 0u);
    EXPECT_EQ(triangles[3 * i - 5], i - 1);
    EXPECT_EQ(triangles[3 * i - 4], i);
  }
}

TEST(PolygonCutTest, ConcavePolygonsAreCoveredOnce) {
  const std::vector<Vec3f> chevron = {{-1, -1, 0}, {0, 0.5f, 0}, {1, -1, 0}, {0, 1, 0}};
  for (size_t first = 0; first < 4; ++first) {
    std::vector<Vec3f> polygon;
    for (size_t i = 0; i < 4; ++i) polygon.push_back(chevron[(first + i) % 4]);
    ExpectCovers(polygon);
  }
  std::vector<Vec3f> comb;
  for (int i = 0; i < 200; ++i) {
    const auto x = static_cast<float>(i);
    comb.push_back({x, i % 2 == 0 ? 0.0f : 100.0f, 0});
  }
  comb.push_back({199, 101, 0});
  comb.push_back({0, 101, 0});
  ExpectCovers(comb);
  // A wound corridor.
  std::vector<Vec3f> spiral;
  const auto at = [](int i, double inset) {
    const double angle = 0.3 * i, r = 1 + 0.05 * i - inset;
    return Vec3f{static_cast<float>(r * std::cos(angle)), static_cast<float>(r * std::sin(angle)),
                 0};
  };
  for (int i = 0; i < 100; ++i) spiral.push_back(at(i, 0));
  for (int i = 99; i >= 0; --i) spiral.push_back(at(i, 0.4));
  ExpectCovers(spiral);
}

// Corners on a fine grid around a point that sees them all, so that no edges cross.
TEST(PolygonCutTest, RandomPolygonsAreCoveredOnce) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> radius(0.02, 1);
  for (int round = 0; round < 300; ++round) {
    const int count = 4 + round % 60;
    std::vector<Vec3f> polygon;
    for (int i = 0; i < count; ++i) {
      const double angle = 6.283185307179586 * i / count,
                   r = std::pow(radius(random), 3) * 1e6 + 100;
      polygon.push_back({static_cast<float>(std::round(r * std::cos(angle))),
                         static_cast<float>(std::round(r * std::sin(angle))), 0});
    }
    ExpectCovers(polygon);
    // In flat triples, and far from the origin, where the corners lie on few floats.
    std::vector<Vec3f> halved;
    for (size_t i = 0; i < polygon.size(); ++i) {
      const Vec3f p = polygon[i], q = polygon[(i + 1) % polygon.size()];
      halved.push_back(p + p);
      halved.push_back(p + q);
    }
    ExpectCovers(halved);
  }
}

TEST(PolygonCutTest, HolesMayBeJoinedToTheOutline) {
  // A square with a square hole, joined by an edge that is passed twice.
  const std::vector<Vec3f> polygon = {{0, 0, 0}, {9, 0, 0}, {9, 9, 0}, {0, 9, 0}, {0, 0, 0},
                                      {3, 3, 0}, {3, 6, 0}, {6, 6, 0}, {6, 3, 0}, {3, 3, 0}};
  std::vector<uint32_t> triangles;
  ASSERT_EQ(Cut(polygon, &triangles), PolygonCutter::Result::kCut);
  double area = 0;
  for (size_t i = 0; i < triangles.size(); i += 3) {
    const Vec3d a = ToDouble(polygon[triangles[i]]);
    const double z =
        Cross(ToDouble(polygon[triangles[i + 1]]) - a, ToDouble(polygon[triangles[i + 2]]) - a).z;
    EXPECT_GE(z, 0);
    area += 0.5 * z;
  }
  EXPECT_EQ(area, 81 - 9);
}

TEST(PolygonCutTest, EveryPlaneIsCutAlike) {
  const std::vector<Vec2f> chevron = {{-1, -1}, {0, 0.5f}, {1, -1}, {0, 1}};
  const std::pair<Vec3f, Vec3f> planes[] = {{{1, 0, 0}, {0, 1, 0}},
                                            {{0, 1, 0}, {0, 0, 1}},
                                            {{0, 0, 1}, {1, 0, 0}},
                                            {{1, 2, 3}, {-3, 1, 0.5f}}};
  for (const auto& [u, v] : planes) {
    std::vector<Vec3f> polygon;
    for (const Vec2f p : chevron) polygon.push_back(Vec3f{5, 6, 7} + u * p.x + v * p.y);
    std::vector<uint32_t> triangles;
    ASSERT_EQ(Cut(polygon, &triangles), PolygonCutter::Result::kCut);
    double area = 0;
    for (size_t i = 0; i < 6; i += 3) {
      const Vec3d a = ToDouble(polygon[triangles[i]]);
      area += 0.5 * Length(Cross(ToDouble(polygon[triangles[i + 1]]) - a,
                                 ToDouble(polygon[triangles[i + 2]]) - a));
    }
    EXPECT_NEAR(area, 0.5 * Length(Cross(ToDouble(u), ToDouble(v))), 1e-6 * area);
  }
}

TEST(PolygonCutTest, PolygonsWithoutInsideAreFans) {
  std::vector<uint32_t> triangles;
  const std::vector<uint32_t> fan = {0, 1, 2, 0, 2, 3};
  EXPECT_EQ(Cut({{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}, &triangles),
            PolygonCutter::Result::kCrosses);  // A bow tie, whose areas cancel.
  EXPECT_EQ(triangles, fan);
  EXPECT_EQ(Cut({{0, 0, 0}, {1, 1, 0}, {2, 2, 0}, {3, 3, 0}}, &triangles),
            PolygonCutter::Result::kCut);  // A line.
  EXPECT_EQ(triangles, fan);
  EXPECT_EQ(Cut({{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, &triangles),
            PolygonCutter::Result::kCut);
  // Two loops of unequal size.
  EXPECT_EQ(Cut({{0, 0, 0}, {4, 4, 0}, {4, 0, 0}, {1, 3, 0}}, &triangles),
            PolygonCutter::Result::kCrosses);
}

TEST(PolygonCutTest, EarsHaveALimit) {
  std::vector<Vec3f> comb;
  for (size_t i = 0; i <= PolygonCutter::kCornersMax; ++i) {
    comb.push_back({static_cast<float>(i), i % 2 == 0 ? 0.0f : 100.0f, 0});
  }
  comb.push_back({0, 200, 0});
  std::vector<uint32_t> triangles;
  EXPECT_EQ(Cut(comb, &triangles), PolygonCutter::Result::kTooMany);
}

}  // namespace
}  // namespace sheaf
