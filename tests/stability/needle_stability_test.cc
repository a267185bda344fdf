// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of triangle intersection, named as in the catalogue: G4 (false hits on skinny
// triangles that are hit nearly edge-on).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>

#include "gtest/gtest.h"
#include "tests/support/exact.h"
#include "tests/support/globe.h"
#include "tests/support/hard_case.h"
#include "tests/support/long_tests.h"
#include "tests/support/naive_geometry.h"
#include "tests/support/test_scene.h"
#include "tests/support/traced_scene.h"
#include "worker/render/geometry/needle.h"
#include "worker/render/geometry/surface_point.h"

namespace sheaf::render {
namespace {

// A triangle that is ten to ten million times as long as wide.
struct Needle {
  Vec3f p[3];
};
Needle MakeNeedle(Random* random) {
  const auto scale = static_cast<float>(std::pow(10.0, random->Uniform(-3, 3)));
  const auto slimness = static_cast<float>(std::pow(10.0, random->Uniform(-7, -1)));
  const Vec3f base = random->Direction() * (scale * static_cast<float>(random->Uniform(0, 10)));
  const Vec3f tip = base + random->Direction() * scale;
  const Vec3f side = base + (tip - base) * static_cast<float>(random->Uniform()) +
                     random->Direction() * (scale * slimness);
  return {{base, tip, side}};
}
// The ray's origin and target are close to the needle's plane, so most rays nearly lie in it.
Ray RayAlong(const Needle& needle, Random* random) {
  const Vec3f* p = needle.p;
  const float length = Length(p[1] - p[0]);
  const auto flatness = static_cast<float>(std::pow(10.0, random->Uniform(-7, 0)));
  const auto near_plane = [&] {
    return p[0] + (p[1] - p[0]) * static_cast<float>(random->Uniform(-1, 2)) +
           (p[2] - p[0]) * static_cast<float>(random->Uniform(-1, 2)) +
           random->Direction() * (length * flatness);
  };
  Ray ray;
  ray.o = near_plane();
  ray.d = near_plane() - ray.o;
  return ray;
}

// Whether the ray hits the triangle, by exact arithmetic: the line passes all three edges on one
// side, or touches them, and the plane is ahead.
bool IntersectsExactly(const Ray& ray, const Needle& needle) {
  const ExactVector o(ray.o), d(ray.d);
  const ExactVector a[3] = {ExactVector(needle.p[0]) - o, ExactVector(needle.p[1]) - o,
                            ExactVector(needle.p[2]) - o};
  bool left = false, right = false;
  Exact volume;
  for (size_t i = 0; i < 3; ++i) {
    const Exact edge = Dot(d, Cross(a[i], a[(i + 1) % 3]));
    left |= edge.Sign() > 0;
    right |= edge.Sign() < 0;
    volume = volume + edge;
  }
  const ExactVector n = Cross(a[1] - a[0], a[2] - a[0]);
  return left != right && Dot(a[0], n).Sign() * volume.Sign() > 0;
}

// In long double, where products of two floats are exact.
using Real = long double;
using Vec3l = Vec3<Real>;
Vec3l ToReal(Vec3f v) { return {v.x, v.y, v.z}; }

// The smallest distance of the ray from the segment a b, with tolerance for a ray that starts on
// it.
Real DistanceToEdge(const Ray& ray, Vec3f from, Vec3f to) {
  const Vec3l o = ToReal(ray.o), d = ToReal(ray.d), a = ToReal(from), e = ToReal(to) - a;
  const Vec3l w = a - o;
  const Real dd = Dot(d, d), de = Dot(d, e), ee = Dot(e, e);
  const Real determinant = LengthSquared(Cross(d, e));
  Real s = determinant > 0 ? Dot(Cross(w, d), Cross(d, e)) / determinant : 0;
  s = std::clamp<Real>(s, 0, 1);
  const Real t = std::max<Real>(0, (Dot(w, d) + s * de) / dd);
  s = std::clamp<Real>((t * de - Dot(w, e)) / ee, 0, 1);
  return Length(w + e * s - d * t);
}
Real DistanceToEdges(const Ray& ray, const Needle& needle) {
  Real least = std::numeric_limits<Real>::infinity();
  for (size_t i = 0; i < 3; ++i) {
    least = std::min(least, DistanceToEdge(ray, needle.p[i], needle.p[(i + 1) % 3]));
  }
  return least;
}
// The magnitude of the numbers that the hit is computed from.
Real ScaleOf(const Ray& ray, const Needle& needle) {
  Real scale = 0;
  for (const Vec3f v : {ray.o, needle.p[0], needle.p[1], needle.p[2]}) {
    for (size_t i = 0; i < 3; ++i) scale = std::max(scale, std::fabs(static_cast<Real>(v[i])));
  }
  return scale;
}

Vec3d NormalOf(const Needle& needle) {
  const Vec3d p = ToDouble(needle.p[0]);
  return Cross(ToDouble(needle.p[1]) - p, ToDouble(needle.p[2]) - p);
}
double CosineOf(const Ray& ray, const Needle& needle) {
  const Vec3d n = NormalOf(needle), d = ToDouble(ray.d);
  return std::fabs(Dot(n, d)) / (Length(n) * Length(d));
}
// The smallest height over the longest side.
double SlimnessOf(const Needle& needle) {
  double longest_square = 0;
  for (size_t i = 0; i < 3; ++i) {
    longest_square = std::max(
        longest_square, LengthSquared(ToDouble(needle.p[(i + 1) % 3]) - ToDouble(needle.p[i])));
  }
  return Length(NormalOf(needle)) / longest_square;
}

// Distance to an edge, relative to the scale, at which both answers are acceptable.
constexpr Real kOnEdge = 0x1p-19L;
// The tracer's first test, in single precision, may miss a needle if the ray passes its edge closer
// than this and almost parallel to it.
constexpr Real kMissed = 0x1p-14L;
// Triangles that are not needles are not tested again. If the cosine between ray and normal is
// above kFlat, their hits are accurate to kStoutError.
constexpr double kFlat = 1e-3;
constexpr Real kStoutError = 0x1p-13L;

// G4. Expected by the catalogue: "double re-test when |det| small; clamp t to the box of the
// triangle. Test: exact rational oracle on 1e5 random needles". Hence there is no hit where exact
// arithmetic has none, except at edges; no hit is lost; and t and the surface point describe the
// same point, on the ray. Without the test in double, a third of the hits are false, by up to 0.8
// of the scale.
TEST(NeedleStability, G4HitsMatchExactArithmetic) {
  const int needle_count = DrawCount(4000, 100000);
  constexpr int kRaysEach = 50;
  Random random(8);
  int hits = 0, missed = 0;
  Real false_by = 0, off_ray = 0, off_t = 0, stout_error = 0, naive_false_by = 0;
  for (int i = 0; i < needle_count; ++i) {
    const Needle needle = MakeNeedle(&random);
    TestScene t({0, 0, 0}, {0, 0, 1}, 60);
    t.AddShape(MeshShape{t.AddMesh({needle.p[0], needle.p[1], needle.p[2]}, {0, 1, 2})}, kNone);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    if (scene->geometry.groups[0].meshes.empty()) continue;  // Zero area.
    const BakedMesh& mesh = scene->geometry.groups[0].meshes[0];
    const bool is_needle = HasNeedles(mesh.positions, mesh.indices);
    for (int k = 0; k < kRaysEach; ++k) {
      const Ray ray = RayAlong(needle, &random);
      const Real scale = ScaleOf(ray, needle);
      const Real edge = DistanceToEdges(ray, needle) / scale;
      const bool intersects = IntersectsExactly(ray, needle);
      if (!intersects &&
          naive::IntersectsTriangle(ray.o, ray.d, needle.p[0], needle.p[1], needle.p[2])) {
        naive_false_by = std::max(naive_false_by, edge);
      }
      RawHit hit;
      const bool is_hit = scene->tracer->Intersect(ray, &hit);
      EXPECT_EQ(is_hit, scene->tracer->Occluded(ray));
      if (!is_hit) {
        missed += intersects && edge > kMissed;
        continue;
      }
      const SurfacePoint point = MakeSurfacePoint<kAllTraits>(scene->geometry, ray, hit);
      const Vec3l q = ToReal(point.p) - ToReal(ray.o), d = ToReal(ray.d);
      const Real aside = Length(q - d * (Dot(q, d) / Dot(d, d))) / scale;
      if (!is_needle) {
        if (CosineOf(ray, needle) > kFlat) stout_error = std::max(stout_error, aside);
        continue;
      }
      ++hits;
      if (!intersects) false_by = std::max(false_by, edge);
      off_ray = std::max(off_ray, aside);
      off_t = std::max(off_t, Length(q - d * static_cast<Real>(hit.t)) / scale);
    }
  }
  EXPECT_GT(hits, needle_count / 2);
  ExpectHardCase({.row = "G4",
                  .figure = "distance of the falsest hit from its needle, in parts of the scene",
                  .expected = 0,
                  .measured = false_by,
                  .tolerance = kOnEdge,
                  .naive = naive_false_by,
                  .naive_by = "the test of Moeller and Trumbore"});
  EXPECT_EQ(missed, 0);
  EXPECT_LT(off_ray, kOnEdge);
  EXPECT_LT(off_t, kOnEdge);
  EXPECT_LT(stout_error, kStoutError);
}

// G4: the nearer of a needle and a wall through it is hit, by true distances. If the wall is hit
// first, however, the tracer searches for the needle by its own distance, whose error grows for
// slim needles and flat incidence.
TEST(NeedleStability, G4NeedlesAreOrderedWithOtherTriangles) {
  const int needle_count = DrawCount(400, 10000);
  Random random(9);
  int hits = 0, wrong = 0;
  for (int i = 0; i < needle_count; ++i) {
    const Needle needle = MakeNeedle(&random);
    const Vec3f* p = needle.p;
    const float length = Length(p[1] - p[0]);
    // A large triangle through a point of the needle.
    const Vec3f middle = p[0] + (p[1] - p[0]) * static_cast<float>(random.Uniform());
    const Vec3f x = random.Direction() * (10 * length), y = random.Direction() * (10 * length);
    TestScene t({0, 0, 0}, {0, 0, 1}, 60);
    t.AddShape(MeshShape{t.AddMesh({p[0], p[1], p[2]}, {0, 1, 2})}, kNone);
    t.AddShape(MeshShape{t.AddMesh({middle + x, middle - x + y, middle - x - y}, {0, 1, 2})},
               kNone);
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    if (scene->geometry.groups[0].meshes.size() < 2) continue;
    for (int k = 0; k < 100; ++k) {
      const Ray ray = RayAlong(needle, &random);
      RawHit hit;
      if (!scene->tracer->Intersect(ray, &hit)) continue;
      // Tested alone, each has its own distance; tested together, the smaller one is hit.
      Ray past = ray;
      past.source = hit.id;
      RawHit other;
      if (!scene->tracer->Intersect(past, &other)) continue;
      ++hits;
      const double rounding = static_cast<double>(kOnEdge * ScaleOf(ray, needle)) /
                              (SlimnessOf(needle) * CosineOf(ray, needle));
      wrong += static_cast<double>(hit.t - other.t) * Length(ToDouble(ray.d)) > rounding;
    }
  }
  EXPECT_GT(hits, needle_count);
  EXPECT_EQ(wrong, 0);
}

// G4: the furnace of a room of needles that all emit and reflect half: 1 / (1 - 1/2), and no path
// is lost.
TEST(NeedleStability, G4FurnaceOfNeedlesKeepsItsEnergy) {
  const Triangles globe = Globe({0, 0, 0}, 4, 1000);
  ASSERT_TRUE(HasNeedles(globe.positions, globe.indices));
  TestScene t({0.1, 0.2, 0.3}, {0, 0, 1}, 90);
  ShapeDescription& room =
      t.AddShape(MeshShape{t.AddMesh(globe.positions, globe.indices)}, t.Diffuse(Rgb::Gray(0.5f)));
  room.reverse_orientation = true;
  room.area_light = t.AreaLight(Rgb::Gray(1));
  ExpectMean(RenderMean(t.scene, SquareSettings(8, 64, 1000)), Rgb::Gray(2));
}

}  // namespace
}  // namespace sheaf::render
