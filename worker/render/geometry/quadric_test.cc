// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/geometry/quadric.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "gtest/gtest.h"

namespace sheaf::render {
namespace {

constexpr double kPi = std::numbers::pi;

class RandomRays {
 public:
  double Uniform(double a, double b) {
    return a + (b - a) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  Vec3d InBox(double half) {
    return {Uniform(-half, half), Uniform(-half, half), Uniform(-half, half)};
  }

 private:
  std::mt19937_64 engine_{11};
};

Affine SomeTransform() {
  Affine m;
  m.x = {2, 0.5, -0.25};
  m.y = {-0.5, 1, 0.75};
  m.z = {0.125, -0.5, 1.5};
  m.offset = {7, -3, 11};
  return m;
}
void Place(const Affine& target_from_object, Quadric* q) {
  q->target_from_object = target_from_object;
  q->object_from_target = Inverse(target_from_object);
}

// Both roots for a whole sphere about the origin, with a 64-bit mantissa.
struct Roots {
  long double discriminant;  // Relative to that of a ray through the center.
  long double t0, t1;
};
Roots SphereRoots(double radius, Vec3d o, Vec3d d) {
  const long double ox = o.x, oy = o.y, oz = o.z, dx = d.x, dy = d.y, dz = d.z, r = radius;
  const long double a = dx * dx + dy * dy + dz * dz, b = ox * dx + oy * dy + oz * dz;
  const long double cx = oy * dz - oz * dy, cy = oz * dx - ox * dz, cz = ox * dy - oy * dx;
  const long double below = r * r * a - (cx * cx + cy * cy + cz * cz);
  const long double root = below > 0 ? std::sqrt(below) : 0;
  return {below / (r * r * a), (-b - root) / a, (-b + root) / a};
}

TEST(QuadricTest, SphereHitsMatchLongDouble) {
  RandomRays random;
  int hits = 0, missed = 0;
  for (int i = 0; i < 20000; ++i) {
    SphereShape shape;
    shape.radius = static_cast<float>(std::pow(10.0, random.Uniform(-3, 3)));
    shape.z_min = -shape.radius;
    shape.z_max = shape.radius;
    const Quadric sphere = MakeQuadric(shape);
    EXPECT_FALSE(sphere.is_partial);
    const double far = sphere.radius * std::pow(10.0, random.Uniform(-1, 5));
    const Vec3d o = random.InBox(far);
    const Vec3d d = (random.InBox(1.5 * sphere.radius) - o) * random.Uniform(0.01, 3);
    const Roots roots = SphereRoots(sphere.radius, o, d);
    if (std::fabs(roots.discriminant) < 1e-6L) continue;  // Grazing rays may hit or miss.
    const std::optional<double> t = IntersectQuadric(sphere, o, d, HUGE_VAL);
    const bool should_hit = roots.discriminant > 0 && roots.t1 > 0;
    ASSERT_EQ(t.has_value(), should_hit) << i;
    if (!should_hit) {
      ++missed;
      continue;
    }
    ++hits;
    const auto expected = static_cast<double>(roots.t0 > 0 ? roots.t0 : roots.t1);
    // Position error divided by the half chord's slope; positions are known to ulps of |o|.
    const double allowed = 1e-14 * (Length(o) + sphere.radius) / Length(d) /
                           std::sqrt(static_cast<double>(roots.discriminant));
    EXPECT_NEAR(*t, expected, allowed) << i;
    EXPECT_FALSE(
        IntersectQuadric(sphere, o, d, std::min(*t, expected) * (1 - 1e-9) - allowed).has_value());
  }
  EXPECT_GT(hits, 5000);
  EXPECT_GT(missed, 2000);
}

// A sphere cut in z and phi, and a ring: rays hit exactly the points that remain.
TEST(QuadricTest, PartialQuadricsAreHitCorrectly) {
  SphereShape cut;
  cut.radius = 2;
  cut.z_min = 1.5f;  // In reverse order.
  cut.z_max = -1;
  cut.phi_max_degrees = 200;
  Quadric sphere = MakeQuadric(cut);
  Place(SomeTransform(), &sphere);
  DiskShape ring;
  ring.radius = 2;
  ring.inner_radius = 0.75f;
  ring.height = 0.5f;
  ring.phi_max_degrees = 120;
  Quadric disk = MakeQuadric(ring);
  Place(SomeTransform(), &disk);
  EXPECT_TRUE(sphere.is_partial && disk.is_partial);
  RandomRays random;
  int hits = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vec3d o = random.InBox(3), d = random.InBox(1);
    const Affine& m = sphere.target_from_object;
    const auto keeps = [&](const Quadric& q, Vec3d p) {
      const double phi = std::atan2(p.y, p.x);
      if ((phi < 0 ? phi + 2 * kPi : phi) > q.phi_max) return false;
      return q.kind == Quadric::Kind::kSphere
                 ? p.z >= q.z_min && p.z <= q.z_max
                 : std::hypot(p.x, p.y) >= q.inner_radius && std::hypot(p.x, p.y) <= q.radius;
    };
    const auto expect = [&](const Quadric& q, std::initializer_list<double> roots) {
      const std::optional<double> t = IntersectQuadric(q, m.Point(o), m.Vector(d), HUGE_VAL);
      for (const double root : roots) {
        if (!(root > 0) || !keeps(q, o + d * root)) continue;
        ++hits;
        ASSERT_TRUE(t.has_value()) << i;
        EXPECT_NEAR(*t, root, 1e-11 * (1 + root)) << i;
        return;
      }
      EXPECT_FALSE(t.has_value()) << i;
    };
    const Roots roots = SphereRoots(2, o, d);
    if (std::fabs(roots.discriminant) > 1e-3L) {
      if (roots.discriminant > 0) {
        expect(sphere, {static_cast<double>(roots.t0), static_cast<double>(roots.t1)});
      } else {
        expect(sphere, {});
      }
    }
    if (std::fabs(d.z) > 1e-3) expect(disk, {(0.5 - o.z) / d.z});
  }
  EXPECT_GT(hits, 2500);
}

// Points lie on the quadric, inside its bounds; their parameters reproduce them, and tangents match
// finite differences of the parameters.
TEST(QuadricTest, PointsBoundsAndParametersAgree) {
  Quadric sphere = MakeQuadric(SphereShape{1.5f, -1, 1.25f, 300});
  Place(SomeTransform(), &sphere);
  const std::array<Vec3f, 2> bounds = QuadricBounds(sphere);
  const double theta_min = std::acos(-1 / 1.5), theta_max = std::acos(1.25 / 1.5);
  const auto at = [&](double u, double v) {
    const double phi = u * sphere.phi_max, theta = theta_min + v * (theta_max - theta_min);
    return Vec3d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                 std::cos(theta)} *
           1.5;
  };
  const Affine& m = sphere.target_from_object;
  for (double u = 0.05; u < 1; u += 0.1) {
    for (double v = 0.05; v < 1; v += 0.1) {
      const Vec3d object = at(u, v), target = m.Point(object);
      // A ray along the radius, stopped slightly off the surface.
      const Vec3d d = m.Vector(object);
      const QuadricPoint point = QuadricPointAt(sphere, m.offset, d, 1 + 1e-7);
      EXPECT_NEAR(Length(point.p - target), 0, 1e-14 * 20);
      EXPECT_NEAR(Length(point.n), 1, 1e-15);
      EXPECT_GT(Dot(point.n, d), 0);
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_GE(point.p[i], bounds[0][i]);
        EXPECT_LE(point.p[i], bounds[1][i]);
      }
      const QuadricParameters parameters = QuadricParametersAt(sphere, point.p_object);
      EXPECT_NEAR(parameters.uv.x, u, 1e-7);
      EXPECT_NEAR(parameters.uv.y, v, 1e-7);
      constexpr double kStep = 1e-6;
      const Vec3d du = m.Vector(at(u + kStep, v) - at(u - kStep, v)) * (0.5 / kStep);
      const Vec3d dv = m.Vector(at(u, v + kStep) - at(u, v - kStep)) * (0.5 / kStep);
      EXPECT_NEAR(Length(parameters.dpdu - du), 0, 1e-7);
      EXPECT_NEAR(Length(parameters.dpdv - dv), 0, 1e-7);
      EXPECT_NEAR(Dot(point.n, du), 0, 1e-7);
      EXPECT_NEAR(Dot(point.n, dv), 0, 1e-7);
    }
  }
}

Quadric SomeCylinder() {
  Quadric cylinder = MakeQuadric(CylinderShape{1.5f, 1.25f, -1, 300});  // z in reverse order.
  Place(SomeTransform(), &cylinder);
  return cylinder;
}

// Against roots with a 64-bit mantissa, from inside and outside, whole and cut.
TEST(QuadricTest, CylinderHitsMatchLongDouble) {
  RandomRays random;
  int hits = 0, missed = 0;
  for (int i = 0; i < 20000; ++i) {
    Quadric cylinder = MakeQuadric(CylinderShape{1.5f, -1, 1.25f, i % 2 == 0 ? 360.0f : 200.0f});
    Place(SomeTransform(), &cylinder);
    const double far = std::pow(10.0, random.Uniform(-1, 5));
    const Vec3d o = random.InBox(far), d = (random.InBox(2) - o) * random.Uniform(0.01, 3);
    const Roots roots = SphereRoots(1.5, {o.x, o.y, 0}, {d.x, d.y, 0});
    if (std::fabs(roots.discriminant) < 1e-4L) continue;
    double expected = HUGE_VAL;
    bool is_clear = true;
    for (const double root : {static_cast<double>(roots.t0), static_cast<double>(roots.t1)}) {
      if (!(roots.discriminant > 0 && root > 0)) continue;
      const Vec3d p = o + d * root;
      const double phi = std::atan2(p.y, p.x), turn = phi < 0 ? phi + 2 * kPi : phi;
      const double inside = std::min({p.z + 1, 1.25 - p.z, cylinder.phi_max - turn, turn});
      is_clear &=
          i % 2 == 0 ? std::fabs(std::min(p.z + 1, 1.25 - p.z)) > 1e-8 : std::fabs(inside) > 1e-8;
      const bool keeps = p.z > -1 && p.z < 1.25 && turn < cylinder.phi_max;
      if (keeps) expected = std::min(expected, root);
    }
    if (!is_clear) continue;
    const Affine& m = cylinder.target_from_object;
    const std::optional<double> t = IntersectQuadric(cylinder, m.Point(o), m.Vector(d), HUGE_VAL);
    ASSERT_EQ(t.has_value(), expected < HUGE_VAL) << i;
    if (!t.has_value()) {
      ++missed;
      continue;
    }
    ++hits;
    const double allowed = 1e-13 * (Length(o) + 2) / Length(Vec3d{d.x, d.y, 0}) /
                           std::sqrt(static_cast<double>(roots.discriminant));
    EXPECT_NEAR(*t, expected, allowed) << i;
    EXPECT_FALSE(
        IntersectQuadric(cylinder, m.Point(o), m.Vector(d), expected * (1 - 1e-6)).has_value());
  }
  EXPECT_GT(hits, 5000);
  EXPECT_GT(missed, 2000);
}

// Rays along the axis pass through the opening, or miss.
TEST(QuadricTest, RaysAlongACylinderAxisMiss) {
  const Quadric cylinder = MakeQuadric(CylinderShape{});
  for (const double x : {0.0, 0.5, 1.0, 2.0}) {
    EXPECT_FALSE(IntersectQuadric(cylinder, {x, 0, -5}, {0, 0, 1}, HUGE_VAL).has_value()) << x;
  }
  // Nearly along the axis, from inside: hits the wall if it is long enough.
  const Quadric tube = MakeQuadric(CylinderShape{1, 0, 1e7f, 360});
  const std::optional<double> t = IntersectQuadric(tube, {0.5, 0, 0}, {1e-6, 0, 1}, HUGE_VAL);
  ASSERT_TRUE(t.has_value());
  EXPECT_NEAR(*t, 5e5, 1e-9);
  EXPECT_FALSE(IntersectQuadric(tube, {0.5, 0, 0}, {1e-9, 0, 1}, HUGE_VAL).has_value());
}

TEST(QuadricTest, CylinderPointsBoundsAndParametersAgree) {
  const Quadric cylinder = SomeCylinder();
  const std::array<Vec3f, 2> bounds = QuadricBounds(cylinder);
  const auto at = [&](double u, double v) {
    const double phi = u * cylinder.phi_max;
    return Vec3d{1.5 * std::cos(phi), 1.5 * std::sin(phi), -1 + 2.25 * v};
  };
  const Affine& m = cylinder.target_from_object;
  Vec3d lower{HUGE_VAL, HUGE_VAL, HUGE_VAL}, upper = -lower;
  for (double u = 0.025; u < 1; u += 0.05) {
    for (const double v : {0.0, 0.25, 0.75, 1.0}) {
      const Vec3d object = at(u, v), target = m.Point(object);
      const Vec3d d = m.Vector({object.x, object.y, 0});
      const QuadricPoint point = QuadricPointAt(cylinder, target - d, d, 1 + 1e-7);
      EXPECT_NEAR(Length(point.p - target), 0, 1e-14 * 20);
      EXPECT_NEAR(Length(point.n), 1, 1e-15);
      EXPECT_GT(Dot(point.n, d), 0);
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_GE(point.p[i], bounds[0][i]);
        EXPECT_LE(point.p[i], bounds[1][i]);
        lower[i] = std::min(lower[i], point.p[i]);
        upper[i] = std::max(upper[i], point.p[i]);
      }
      const QuadricParameters parameters = QuadricParametersAt(cylinder, point.p_object);
      EXPECT_NEAR(parameters.uv.x, u, 1e-7);
      EXPECT_NEAR(parameters.uv.y, v, 1e-7);
      constexpr double kStep = 1e-6;
      const Vec3d du = m.Vector(at(u + kStep, v) - at(u - kStep, v)) * (0.5 / kStep);
      const Vec3d dv = m.Vector(at(u, v + kStep) - at(u, v - kStep)) * (0.5 / kStep);
      EXPECT_NEAR(Length(parameters.dpdu - du), 0, 1e-7);
      EXPECT_NEAR(Length(parameters.dpdv - dv), 0, 1e-7);
      EXPECT_NEAR(Dot(point.n, du), 0, 1e-7);
      EXPECT_NEAR(Dot(point.n, dv), 0, 1e-7);
      EXPECT_GT(Dot(point.n, Cross(du, dv)), 0);
    }
  }
  // The bounds are tight: those of the whole circles.
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_LT(lower[i] - bounds[0][i], 0.3);
    EXPECT_LT(bounds[1][i] - upper[i], 0.3);
  }
}

// If the transform cancels a large z of an end, the points keep its rounding error.
TEST(QuadricTest, CoordinateMaxBoundsTheHitPoints) {
  Quadric cylinder = MakeQuadric(CylinderShape{1, 1e6f, 1e6f + 1, 360});
  Affine back;
  back.offset = {0, 0, -1e6};
  Place(back, &cylinder);
  const std::array<Vec3f, 2> bounds = QuadricBounds(cylinder);
  EXPECT_NEAR(bounds[1].z, 1, 1e-6);
  EXPECT_GE(QuadricCoordinateMax(cylinder, bounds).z, 1e6f);
  EXPECT_NEAR(QuadricCoordinateMax(cylinder, bounds).x, 1, 1e-6);
}

}  // namespace
}  // namespace sheaf::render
