// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Samples points on triangles, spheres and disks as seen from a receiver at p, with pdfs in solid
// angle. Every shape has a View, which holds everything that depends on (shape, p) only, so that
// sampling and evaluation choose the same technique and give bit-identical pdfs. Inputs are floats;
// the arithmetic is in double, so differences are exact and no formula breaks down at any distance
// or size. Space: any, the same for all arguments.
//
// A View is not `visible` where the receiver lies in the shape's plane to within the rounding of
// the coordinates (no constant depends on the scene's scale), or where the shape has no size; the
// pdf is then 0 and there is nothing to sample.
//
// Triangles and spheres are inline: a View of twenty numbers is neither stored nor loaded where it
// is used at once.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/math/elementary.h"
#include "common/math/vec.h"

namespace sheaf::render {

struct ShapePoint {
  Vec3d wi;  // Unit, from the receiver to the point.
  Vec3d p;   // On the shape.
  Vec3d n;   // Unit geometric normal of the shape there.
};

namespace internal {

// Half an ulp of rounding in each of two float coordinates, doubled to allow for the operations
// that produced them.
inline constexpr double kVertexError = 0x1p-23;

inline Vec3d Abs(Vec3d v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }

// Error bound of Dot(normal, p - q) due to rounded coordinates of p and q.
inline double PlaneError(Vec3d normal, Vec3d p, Vec3d q) {
  return kVertexError * Dot(Abs(normal), Abs(p) + Abs(q));
}

// Angles here come from 24-bit samples and go to 24-bit pdfs, so functions accurate to 2^-36
// suffice; arguments and results stay double, because their differences are taken.
inline SinCosPair<double> SinCosOf(double angle) {
  return elementary::SinCosForFloat(static_cast<float>(angle));
}
inline double AngleOf(double y, double x) { return elementary::Atan2ForFloat(y, x); }

inline Vec3d Unit(Vec3d v) { return v * (1 / Length(v)); }

}  // namespace internal

// --- Triangles ---------------------------------------------------------------------------------

// Below this solid angle sampling is by area: the light is a point in float precision.
inline constexpr double kTriangleSolidAngleMin = 1e-14;

struct TriangleView {
  Vec3d a, e1, e2;    // v0 - p, v1 - v0, v2 - v0.
  Vec3d normal_area;  // Cross(e1, e2): twice the area, on the emitting side.
  double triple = 0;  // Dot(a, normal_area); negative on the front side.
  double length_a = 0, length_b = 0, length_c = 0;  // Distances of the vertices.
  double solid_angle = 0;
  bool visible = false;
  bool by_area = false;
  bool front() const { return triple < 0; }
};
// Solid angle by Van Oosterom and Strackee 1983, with the triple product formed from edges.
[[gnu::always_inline]] inline TriangleView ViewTriangle(Vec3f v0, Vec3f v1, Vec3f v2, Vec3f p) {
  TriangleView view;
  const Vec3d q0 = ToDouble(v0), pd = ToDouble(p);
  view.a = q0 - pd;
  view.e1 = ToDouble(v1) - q0;
  view.e2 = ToDouble(v2) - q0;
  view.normal_area = Cross(view.e1, view.e2);
  view.triple = Dot(view.a, view.normal_area);
  // Also rejects NaN and triangles without area.
  if (!(std::fabs(view.triple) > internal::PlaneError(view.normal_area, pd, q0))) return view;
  const Vec3d b = view.a + view.e1, c = view.a + view.e2;
  view.length_a = Length(view.a);
  view.length_b = Length(b);
  view.length_c = Length(c);
  const double denominator = view.length_a * view.length_b * view.length_c +
                             Dot(view.a, b) * view.length_c + Dot(b, c) * view.length_a +
                             Dot(c, view.a) * view.length_b;
  view.solid_angle = 2 * internal::AngleOf(std::fabs(view.triple), denominator);
  view.visible = std::isfinite(denominator);
  view.by_area = !(view.solid_angle > kTriangleSolidAngleMin);
  return view;
}

namespace internal {

// Barycentric coordinate with NaN and negative values set to 0.
inline double ClampToUnit(double v) { return v > 0 ? std::min(v, 1.0) : 0; }

// Unit direction, uniform over the spherical triangle of the view.
[[gnu::always_inline]] inline Vec3d SampleSphericalTriangle(const TriangleView& view, Vec2f u) {
  const double scale_a = 1 / view.length_a, scale_b = 1 / view.length_b;
  const double scale_c = 1 / view.length_c;
  const Vec3d a = view.a * scale_a;
  const Vec3d b = (view.a + view.e1) * scale_b;
  const Vec3d c = (view.a + view.e2) * scale_c;
  // The half-angle direction r between a and the point of the arc ac that cuts off, with a and b,
  // the fraction u.x of the solid angle.
  const double g0 = std::fabs(view.triple) * (scale_a * scale_b * scale_c);
  const double g1 = Dot(a + b, c);
  const double g2 = 0.5 * LengthSquared(a + b);
  const SinCosPair<double> half = SinCosOf(0.5 * view.solid_angle * static_cast<double>(u.x));
  const Vec3d r = (g0 * half.cos - g1 * half.sin) * a + (g2 * half.sin) * c;
  const double r_squared = LengthSquared(r);
  const Vec3d c_cut = r_squared > 0 ? (2 * Dot(a, r) / r_squared) * r - a : c;
  // Along the arc from b to that point, uniform in the cosine. 1 - cos and 1 + cos of the whole arc
  // come from its chord and from the sum of its ends: near a receiver in the triangle's plane the
  // arc is almost a half circle, and the last digits of that sum decide which half.
  const double v = static_cast<double>(u.y);
  const Vec3d chord = c_cut - b, sum = c_cut + b;
  const double q = 0.5 * LengthSquared(chord), q_sum = 0.5 * LengthSquared(sum);
  const double t = q_sum > 0 ? std::sqrt(std::max(v * (2 - v * q), 0.0) / q_sum) : v;
  const Vec3d w =
      q < 1 ? b + t * chord + (q * (t - v)) * b : (1 - v * q) * b + t * (sum - q_sum * b);
  return Unit(w);
}

inline ShapePoint SampleTriangleByArea(const TriangleView& view, Vec3f v0, Vec2f u) {
  // Source: Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
  double b1 = static_cast<double>(u.x), b2 = static_cast<double>(u.y);
  if (b1 < b2) {
    b1 *= 0.5;
    b2 -= b1;
  } else {
    b2 *= 0.5;
    b1 -= b2;
  }
  const Vec3d from_v0 = b1 * view.e1 + b2 * view.e2;
  const Vec3d l = view.a + from_v0;
  return {Unit(l), ToDouble(v0) + from_v0, Unit(view.normal_area)};
}

}  // namespace internal

// Samples uniformly in solid angle, or in area if by_area. Source: Arvo 1995; Peters 2021, "BRDF
// Importance Sampling for Polygonal Lights", the half-angle form; here with differences in place of
// 1 - cos. Requires: view.visible.
[[gnu::always_inline]] inline ShapePoint SampleTriangle(const TriangleView& view, Vec3f v0,
                                                        Vec3f /*p*/, Vec2f u) {
  if (view.by_area) return internal::SampleTriangleByArea(view, v0, u);
  const Vec3d w = internal::SampleSphericalTriangle(view, u);
  // Intersection of the ray with the triangle. Source: Moeller and Trumbore 1997.
  const Vec3d p_cross = Cross(w, view.e2);
  const double scale = 1 / Dot(view.e1, p_cross);
  const double b1 = internal::ClampToUnit(-Dot(view.a, p_cross) * scale);
  const double b2 =
      std::min(internal::ClampToUnit(-Dot(w, Cross(view.a, view.e1)) * scale), 1 - b1);
  const Vec3d p_light = ToDouble(v0) + b1 * view.e1 + b2 * view.e2;
  return {w, p_light, internal::Unit(view.normal_area)};
}

// p_light: a point of the triangle. 0 where not visible.
inline double PdfTriangle(const TriangleView& view, Vec3f p, Vec3f p_light) {
  if (!view.visible) return 0;
  if (!view.by_area) return 1 / view.solid_angle;
  // distance^2 / (cos * area), with cosine and area both from the triple product.
  const Vec3d l = ToDouble(p_light) - ToDouble(p);
  return 2 * LengthSquared(l) * Length(l) / std::fabs(view.triple);
}

// --- Spheres -----------------------------------------------------------------------------------

struct SphereView {
  Vec3d to_center;               // center - p.
  double distance = 0;           // To the center.
  double sin_max_squared = 0;    // (radius / distance)^2, at most 1.
  double one_minus_cos_max = 0;  // For the cone that bounds the sphere.
  double pdf = 0;                // Constant over the sphere.
  double error = 0;              // Rounding error bound of distances.
  bool visible = false;
  bool inside = false;
};
// from_inside: the side from which p views the sphere if p is on its surface to within rounding.
[[gnu::always_inline]] inline SphereView ViewSphere(Vec3d center, double radius, bool from_inside,
                                                    Vec3f p) {
  SphereView view;
  const Vec3d pd = ToDouble(p);
  view.to_center = center - pd;
  const double d_squared = LengthSquared(view.to_center);
  view.distance = std::sqrt(d_squared);
  if (!(radius > 0) || !std::isfinite(d_squared)) return view;
  view.visible = true;
  view.error = internal::PlaneError({1, 1, 1}, pd, center);
  view.inside = view.distance < radius + (from_inside ? view.error : -view.error);
  if (view.inside) {
    view.pdf = 1 / (4 * kPi);
    return view;
  }
  view.sin_max_squared = std::min(radius * radius / d_squared, 1.0);
  const double cos_squared =
      std::max((view.distance - radius) * (view.distance + radius) / d_squared, 0.0);
  // 1 - cos = sin^2 / (1 + cos) does not cancel for small cones.
  view.one_minus_cos_max = view.sin_max_squared / (1 + std::sqrt(cos_squared));
  view.pdf = 1 / (2 * kPi * view.one_minus_cos_max);
  view.visible = std::isfinite(view.pdf);
  return view;
}

namespace internal {

// Returns two unit vectors that form a right-handed orthonormal basis with the unit vector n.
// Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
inline void MakeBasis(Vec3d n, Vec3d* t, Vec3d* b) {
  const double sign = std::copysign(1.0, n.z);
  const double a = -1 / (sign + n.z);
  const double xy = n.x * n.y * a;
  *t = {1 + sign * n.x * n.x * a, sign * xy, -sign * n.x};
  *b = {xy, sign + n.y * n.y * a, -n.y};
}

inline ShapePoint SampleSphereFromInside(const SphereView& view, Vec3d center, double radius,
                                         Vec2f u) {
  const double z = 1 - 2 * static_cast<double>(u.x);
  const double r = std::sqrt(std::max(1 - z * z, 0.0));
  const SinCosPair<double> phi = SinCosOf(2 * kPi * static_cast<double>(u.y));
  const Vec3d wi{r * phi.cos, r * phi.sin, z};
  // Where the ray from p along wi leaves the sphere.
  const double along = Dot(view.to_center, wi);
  const double closest_squared = LengthSquared(Cross(view.to_center, wi));
  const double half_chord = std::sqrt(std::max(radius * radius - closest_squared, 0.0));
  const Vec3d from_center = (along + half_chord) * wi - view.to_center;
  const Vec3d n = Unit(from_center);
  return {wi, center + radius * n, n};
}

}  // namespace internal

// Samples uniformly in the cone from outside, and over all directions from inside. n points
// outward. Requires: view.visible.
[[gnu::always_inline]] inline ShapePoint SampleSphere(const SphereView& view, Vec3d center,
                                                      double radius, Vec2f u) {
  if (view.inside) return internal::SampleSphereFromInside(view, center, radius, u);
  const Vec3d axis = view.to_center / view.distance;
  Vec3d t, b;
  internal::MakeBasis(axis, &t, &b);
  const double one_minus_cos = static_cast<double>(u.x) * view.one_minus_cos_max;
  const double cos_theta = 1 - one_minus_cos;
  const double sin_squared = one_minus_cos * (1 + cos_theta);
  const double sin_theta = std::sqrt(sin_squared);
  const SinCosPair<double> phi = internal::SinCosOf(2 * kPi * static_cast<double>(u.y));
  const Vec3d side = phi.cos * t + phi.sin * b;
  // Angle at the center between the receiver and the visible point: sin(alpha) follows from the
  // sine rule, in a form without differences of large distances. Source: pbrt-v4, sec. 6.2.4.
  const double sin_max = std::sqrt(view.sin_max_squared);
  const double ratio = std::min(sin_squared / view.sin_max_squared, 1.0);
  const double cos_alpha = sin_squared / sin_max + cos_theta * std::sqrt(1 - ratio);
  const double sin_alpha = std::sqrt(std::max((1 - cos_alpha) * (1 + cos_alpha), 0.0));
  const Vec3d n = sin_alpha * side - cos_alpha * axis;
  return {cos_theta * axis + sin_theta * side, center + radius * n, n};
}

// --- Disks -------------------------------------------------------------------------------------

// Disks closer than this many radii (to the center) are sampled about the receiver's foot point.
inline constexpr double kDiskPolarDistance = 4;

struct DiskShapeView {
  Vec3d normal, axis_x, axis_y;  // Orthonormal; axis_x points from the foot point to the center.
  Vec3d foot;                    // The receiver projected onto the disk's plane.
  double radius = 0, inner_radius = 0;
  double height = 0;   // The receiver's height above the plane; positive on the front side.
  double offset = 0;   // Distance from the foot point to the center.
  double phi_max = 0;  // Half the angle the disk spans about the foot point.
  bool visible = false;
  bool by_area = false;
  bool front() const { return height > 0; }
};
// normal and axis_x: unit, orthogonal.
DiskShapeView ViewDisk(Vec3d center, Vec3d normal, Vec3d axis_x, double radius, double inner_radius,
                       Vec3f p);
// Samples distant disks uniformly in area; near ones uniformly in the angle about the foot point
// and, along the chord at that angle, in solid angle: weights are bounded at any distance. Sets
// *hit to false where the point is in the hole. Requires: view.visible.
ShapePoint SampleDisk(const DiskShapeView& view, Vec3f p, Vec2f u, bool* hit);
// wi: unit, from p to p_light, a point of the disk. 0 where not visible.
double PdfDisk(const DiskShapeView& view, Vec3f p, Vec3f wi, Vec3f p_light);

}  // namespace sheaf::render
