// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/geometry/bilinear_patch.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "gtest/gtest.h"
#include "worker/render/geometry/needle.h"
#include "worker/render/geometry/surface_point.h"

namespace sheaf::render {
namespace {

class Random {
 public:
  double Uniform(double a, double b) {
    return a + (b - a) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  // A float point in a box, as corners of patches are.
  Vec3d InBox(double half) {
    return ToDouble(ToFloat({Uniform(-half, half), Uniform(-half, half), Uniform(-half, half)}));
  }

 private:
  std::mt19937_64 engine_{17};
};

BilinearPatch RandomPatch(Random* random) {
  return {random->InBox(1), random->InBox(1), random->InBox(1), random->InBox(1)};
}
// A mesh of one patch.
BilinearMesh MeshOf(const BilinearPatch& patch) {
  BilinearMesh mesh;
  mesh.positions = {ToFloat(patch.p00), ToFloat(patch.p10), ToFloat(patch.p01), ToFloat(patch.p11)};
  mesh.indices = {0, 1, 2, 3};
  return mesh;
}

TEST(BilinearPatchTest, PointsAndDerivativesAgree) {
  Random random;
  constexpr double kStep = 1e-6;
  for (int i = 0; i < 200; ++i) {
    const BilinearPatch patch = RandomPatch(&random);
    EXPECT_EQ(patch.PointAt(0, 0), patch.p00);
    EXPECT_EQ(patch.PointAt(1, 0), patch.p10);
    EXPECT_EQ(patch.PointAt(0, 1), patch.p01);
    EXPECT_EQ(patch.PointAt(1, 1), patch.p11);
    const double u = random.Uniform(0, 1), v = random.Uniform(0, 1);
    const Vec3d du = (patch.PointAt(u + kStep, v) - patch.PointAt(u - kStep, v)) * (0.5 / kStep);
    const Vec3d dv = (patch.PointAt(u, v + kStep) - patch.PointAt(u, v - kStep)) * (0.5 / kStep);
    EXPECT_NEAR(Length(patch.DpduAt(v) - du), 0, 1e-8);
    EXPECT_NEAR(Length(patch.DpdvAt(u) - dv), 0, 1e-8);
    EXPECT_NEAR(Length(patch.NormalAt(u, v) - Cross(du, dv)), 0, 1e-8);
    const std::array<Vec3f, 2> bounds = PatchBounds(patch);
    for (size_t k = 0; k < 3; ++k) {
      EXPECT_GT(patch.PointAt(u, v)[k], bounds[0][k]);
      EXPECT_LT(patch.PointAt(u, v)[k], bounds[1][k]);
    }
  }
}

// A corner where two edges coincide has no normal; a point or a line has none anywhere.
TEST(BilinearPatchTest, NormalsAtDegeneratePoints) {
  const BilinearPatch triangle{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}};
  for (const double u : {0.0, 0.3, 1.0}) {
    const Vec3d n = triangle.NormalAt(u, 1);
    EXPECT_EQ(n.x, 0);
    EXPECT_EQ(n.y, 0);
    EXPECT_GT(n.z, 0);
  }
  const BilinearPatch line{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
  EXPECT_EQ(line.NormalAt(0.5, 0.5), (Vec3d{}));
}

// Rays through known points of random patches: the hit is no farther, and on both ray and patch.
TEST(BilinearPatchTest, RaysHitTheirTargets) {
  Random random;
  double worst = 0;
  for (int i = 0; i < 50000; ++i) {
    const BilinearPatch patch = RandomPatch(&random);
    const double u = random.Uniform(0, 1), v = random.Uniform(0, 1);
    const double far = std::pow(10.0, random.Uniform(0, 4));
    const Vec3d o = random.InBox(far), target = patch.PointAt(u, v);
    const Vec3d d = (target - o) * random.Uniform(0.01, 3);
    const double t_target = Length(target - o) / Length(d);
    const std::optional<PatchHit> hit = IntersectPatch(patch, o, d, HUGE_VAL);
    ASSERT_TRUE(hit.has_value()) << i;
    // Nearly tangent rays may find a slightly different point.
    EXPECT_LE(hit->t, t_target * (1 + 1e-6)) << i;
    const Vec3d point = patch.PointAt(hit->u, hit->v);
    worst = std::max(worst, Length(point - (o + d * hit->t)) / far);
    EXPECT_TRUE(hit->u >= 0 && hit->u <= 1 && hit->v >= 0 && hit->v <= 1);
    EXPECT_FALSE(IntersectPatch(patch, o, d, hit->t * (1 - 1e-9)).has_value());
  }
  EXPECT_LT(worst, 1e-12);
}

// Against a tessellation into 64 x 64 pairs of triangles.
TEST(BilinearPatchTest, PatchesMatchTheirTessellations) {
  constexpr int kCuts = 64;
  Random random;
  int hits = 0, missed = 0, twice = 0;
  for (int i = 0; i < 150; ++i) {
    const BilinearPatch patch = RandomPatch(&random);
    const auto at = [&](int a, int b) {
      return patch.PointAt(static_cast<double>(a) / kCuts, static_cast<double>(b) / kCuts);
    };
    for (int k = 0; k < 4; ++k) {
      const Vec3d o = random.InBox(3), d = random.InBox(1) - o;
      double nearest = HUGE_VAL;
      int count = 0;
      bool is_clear = true;  // No intersection is near the border or tangent.
      for (int a = 0; a < kCuts; ++a) {
        for (int b = 0; b < kCuts; ++b) {
          const Vec3d p[4] = {at(a, b), at(a + 1, b), at(a, b + 1), at(a + 1, b + 1)};
          for (const std::array<Vec3d, 3>& corners :
               {std::array{p[0], p[1], p[3]}, std::array{p[0], p[3], p[2]}}) {
            const std::optional<TriangleHit> hit = IntersectTriangle(o, d, corners);
            if (!hit.has_value()) continue;
            const Vec3d n = Cross(corners[1] - corners[0], corners[2] - corners[0]);
            is_clear &= a > 0 && b > 0 && a + 1 < kCuts && b + 1 < kCuts &&
                        std::fabs(Dot(n, d)) > 0.1 * Length(n) * Length(d);
            nearest = std::min(nearest, hit->t);
            ++count;
          }
        }
      }
      if (!is_clear) continue;
      const std::optional<PatchHit> hit = IntersectPatch(patch, o, d, HUGE_VAL);
      if (count == 0) {
        // The tessellation loses slivers near the border only.
        missed += !hit.has_value();
        if (hit.has_value()) {
          const double border =
              std::min(std::min(hit->u, 1 - hit->u), std::min(hit->v, 1 - hit->v));
          const Vec3d n = patch.NormalAt(hit->u, hit->v);
          EXPECT_TRUE(border < 1.0 / kCuts || std::fabs(Dot(n, d)) < 0.15 * Length(n) * Length(d));
        }
        continue;
      }
      ++hits;
      twice += count > 1;
      ASSERT_TRUE(hit.has_value()) << i;
      // The sagitta over 1/64 of an edge of at most 3.5, at a cosine of at least 0.1.
      EXPECT_NEAR(hit->t, nearest, 0.01) << i;
    }
  }
  EXPECT_GT(hits, 60);
  EXPECT_GT(missed, 60);
  EXPECT_GT(twice, 3);
}

// Rays hit planar quads in their planes; convex ones exactly within their borders.
TEST(BilinearPatchTest, FlatQuadsAreHitInTheirPlane) {
  Random random;
  int hits = 0, missed = 0;
  for (int i = 0; i < 20000; ++i) {
    // A trapezoid, which no pair of triangles parametrizes equally.
    const double top = random.Uniform(0.1, 0.9);
    const BilinearPatch patch{{-1, -1, 2}, {1, -1, 2}, {-top, 1, 2}, {top, 1, 2}};
    EXPECT_TRUE(patch.IsFlat());
    const Vec3d o{random.Uniform(-5, 5), random.Uniform(-5, 5), random.Uniform(-5, 1.5)};
    const double x = random.Uniform(-1.5, 1.5), y = random.Uniform(-1.5, 1.5);
    const std::optional<PatchHit> hit = IntersectPatch(patch, o, Vec3d{x, y, 2} - o, HUGE_VAL);
    const double half = 1 + (top - 1) * (y + 1) / 2;
    const double inside = std::min(1 - std::fabs(y), half - std::fabs(x));
    if (std::fabs(inside) < 1e-9) continue;
    ASSERT_EQ(hit.has_value(), inside > 0) << i;
    (inside > 0 ? hits : missed)++;
    if (!hit.has_value()) continue;
    EXPECT_NEAR(hit->t, 1, 1e-13);
    EXPECT_NEAR(hit->v, (y + 1) / 2, 1e-13);
    EXPECT_NEAR(hit->u, (x + half) / (2 * half), 1e-12);
  }
  EXPECT_GT(hits, 3000);
  EXPECT_GT(missed, 3000);
}

// In the plane, behind, beyond, and along a ruling.
TEST(BilinearPatchTest, MissingRaysMiss) {
  const BilinearPatch flat{{-1, -1, 0}, {1, -1, 0}, {-0.5, 1, 0}, {0.5, 1, 0}};
  EXPECT_FALSE(IntersectPatch(flat, {-3, 0.25, 0}, {1, 0, 0}, HUGE_VAL).has_value());
  EXPECT_FALSE(IntersectPatch(flat, {0, 0, 1}, {0, 0, 1}, HUGE_VAL).has_value());
  EXPECT_FALSE(IntersectPatch(flat, {0, 0, 1}, {0, 0, -1}, 1).has_value());
  EXPECT_TRUE(IntersectPatch(flat, {0, 0, 1}, {0, 0, -1}, 1.0001).has_value());
  // z = x y over the unit square: intersects the plane z = 1 only at a corner.
  const BilinearPatch saddle{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 1}};
  EXPECT_FALSE(IntersectPatch(saddle, {-1, 0.5, 1}, {1, 0, 0}, HUGE_VAL).has_value());
  const std::optional<PatchHit> hit = IntersectPatch(saddle, {0.25, 0.5, 3}, {0, 0, -1}, HUGE_VAL);
  ASSERT_TRUE(hit.has_value());
  EXPECT_NEAR(hit->t, 3 - 0.125, 1e-15);
  EXPECT_NEAR(hit->u, 0.25, 1e-15);
  EXPECT_NEAR(hit->v, 0.5, 1e-15);
}

// A ray aimed, in double, at any point of an edge or corner hits the patch from any distance. No
// ray passes between patches that share an edge.
TEST(BilinearPatchTest, G3EdgesAndCornersAreHit) {
  Random random;
  int missed_edges = 0, missed_corners = 0;
  for (int i = 0; i < 100000; ++i) {
    BilinearPatch patch = RandomPatch(&random);
    if (i % 3 == 0) patch.p11 = patch.p10 + patch.p01 - patch.p00;
    if (i % 5 == 0) patch.p01 = patch.p00 + (patch.p01 - patch.p00) * 1e-4;  // Slim.
    if (i % 7 == 0) (i % 2 == 0 ? patch.p11 : patch.p00) = patch.p01;        // A triangle.
    if (i % 7 == 1) (i % 2 == 0 ? patch.p11 : patch.p00) = patch.p10;
    const Vec3d o = random.InBox(std::pow(10.0, random.Uniform(0, 5)));
    const double end = i % 2, at = random.Uniform(0, 1);
    const Vec3d on_edge = i % 4 < 2 ? patch.PointAt(end, at) : patch.PointAt(at, end);
    missed_edges += !IntersectPatch(patch, o, on_edge - o, HUGE_VAL).has_value();
    const Vec3d corner = patch.PointAt(end, i % 4 < 2);
    missed_corners += !IntersectPatch(patch, o, corner - o, HUGE_VAL).has_value();
  }
  EXPECT_EQ(missed_edges, 0);
  EXPECT_EQ(missed_corners, 0);
}

// Texture coordinates and tangents, both with the patch's own parameters and with different uvs.
TEST(BilinearPatchTest, ParametersAndTangentsAgree) {
  BakedPatches baked;
  baked.positions = {{0, 0, 0}, {2, 0, 0.5f}, {0, 1, 0}, {1, 1, 1}};
  baked.indices = {0, 1, 2, 3};
  const BilinearPatch patch = baked.PatchAt(0);
  RawHit hit;
  hit.u = 0.25f;
  hit.v = 0.75f;
  hit.id.primitive = 0;
  internal::GroupPoint point = internal::PointOnPatch(baked, hit, true);
  EXPECT_EQ(point.uv, (Vec2f{0.25f, 0.75f}));
  EXPECT_EQ(point.p, patch.PointAt(0.25, 0.75));
  EXPECT_EQ(point.dpdu, patch.DpduAt(0.75));
  EXPECT_EQ(point.dpdv, patch.DpdvAt(0.25));
  EXPECT_GT(point.ng.z, 0);
  EXPECT_EQ(point.coordinate_max, (Vec3f{2, 1, 1}));
  baked.uvs = {{0, 3}, {0.5f, 4}, {-2, 3.5f}, {-1, 5}};
  point = internal::PointOnPatch(baked, hit, true);
  const auto uv_at = [&](double u, double v) {
    return internal::PatchUvs(baked, baked.indices.data()).PointAt(u, v);
  };
  EXPECT_NEAR(point.uv.x, uv_at(0.25, 0.75).x, 1e-6);
  EXPECT_NEAR(point.uv.y, uv_at(0.25, 0.75).y, 1e-6);
  // A small step on the patch matches its step in uv.
  constexpr double kStep = 1e-6;
  for (const Vec2d step : {Vec2d{kStep, 0}, Vec2d{0, kStep}, Vec2d{kStep, -kStep}}) {
    const Vec3d moved = patch.PointAt(0.25 + step.x, 0.75 + step.y) - point.p;
    const Vec3d uv = uv_at(0.25 + step.x, 0.75 + step.y) - uv_at(0.25, 0.75);
    EXPECT_NEAR(Length(point.dpdu * uv.x + point.dpdv * uv.y - moved), 0, 1e-11);
  }
  // Vertex normals set the shading normal and decide which side is the front.
  baked.normals = {{0, 0, -1}, {0.6f, 0, -0.8f}, {0, 0, -1}, {0, 0, -1}};
  point = internal::PointOnPatch(baked, hit, false);
  EXPECT_LT(point.ng.z, 0);
  EXPECT_NEAR(point.ns.x, 0.6 * 0.25 * 0.25, 1e-7);
  baked.surface.flips_normal = true;
  EXPECT_EQ(internal::PointOnPatch(baked, hit, false).ng, point.ng);
}

TEST(BilinearPatchTest, ParallelogramsAreTriangles) {
  const BilinearPatch square{{1, 2, 3}, {2.5f, 2, 4}, {1, 3, 3}, {2.5f, 3, 4}};
  EXPECT_TRUE(IsTriangles(MeshOf(square), false));
  const TriangleMesh triangles = ToTriangles(MeshOf(square));
  EXPECT_EQ(triangles.indices, (std::vector<uint32_t>{0, 1, 3, 0, 3, 2}));
  EXPECT_EQ(triangles.uvs, (std::vector<Vec2f>{{0, 0}, {1, 0}, {0, 1}, {1, 1}}));
  // Coordinates with six digits: flat enough for a light, which must be flat, but not otherwise.
  BilinearPatch rounded = square;
  rounded.p11.z += 1e-5;
  EXPECT_FALSE(IsTriangles(MeshOf(rounded), false));
  EXPECT_TRUE(IsTriangles(MeshOf(rounded), true));
  BilinearPatch curved = square;
  curved.p11.z += 1e-3;
  EXPECT_FALSE(IsTriangles(MeshOf(curved), true));
  // For a small distant patch the tolerance is relative to its own size.
  const BilinearPatch far{
      {1e4, 0, 0}, {1e4 + 0.01, 0, 0}, {1e4, 0.01, 0}, {1e4 + 0.01, 0.01, 0.002}};
  EXPECT_FALSE(IsTriangles(MeshOf(far), true));
  BilinearMesh bent = MeshOf(square);
  bent.uvs = {{0, 0}, {1, 0}, {0, 1}, {0.5f, 0.5f}};
  EXPECT_FALSE(IsTriangles(bent, false));
  bent.uvs.back() = {1, 1};
  EXPECT_TRUE(IsTriangles(bent, false));
  bent.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 1, 1}};
  EXPECT_FALSE(IsTriangles(bent, false));
}

}  // namespace
}  // namespace sheaf::render
