// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/shape_sampling.h"

#include <algorithm>
#include <cmath>

#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

// Half an ulp of rounding in each of two float coordinates, doubled to allow for the operations
// that produced them.
constexpr double kVertexError = 0x1p-23;

Vec3d Abs(Vec3d v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }

// Error bound of Dot(normal, p - q) due to rounded coordinates of p and q.
double PlaneError(Vec3d normal, Vec3d p, Vec3d q) {
  return kVertexError * Dot(Abs(normal), Abs(p) + Abs(q));
}

// Returns two unit vectors that form a right-handed orthonormal basis with the unit vector n.
// Source: Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
void MakeBasis(Vec3d n, Vec3d* t, Vec3d* b) {
  const double sign = std::copysign(1.0, n.z);
  const double a = -1 / (sign + n.z);
  const double xy = n.x * n.y * a;
  *t = {1 + sign * n.x * n.x * a, sign * xy, -sign * n.x};
  *b = {xy, sign + n.y * n.y * a, -n.y};
}

// Angles here come from 24-bit samples and go to 24-bit pdfs, so functions accurate to 2^-36
// suffice; arguments and results stay double, because their differences are taken.
SinCosPair<double> SinCosOf(double angle) {
  return elementary::SinCosForFloat(static_cast<float>(angle));
}
double AngleOf(double y, double x) { return elementary::Atan2ForFloat(y, x); }

Vec3d Unit(Vec3d v) { return v * (1 / Length(v)); }

// Barycentric coordinate with NaN and negative values set to 0.
double ClampToUnit(double v) { return v > 0 ? std::min(v, 1.0) : 0; }

}  // namespace

TriangleView ViewTriangle(Vec3f v0, Vec3f v1, Vec3f v2, Vec3f p) {
  TriangleView view;
  const Vec3d q0 = ToDouble(v0), pd = ToDouble(p);
  view.a = q0 - pd;
  view.e1 = ToDouble(v1) - q0;
  view.e2 = ToDouble(v2) - q0;
  view.normal_area = Cross(view.e1, view.e2);
  view.triple = Dot(view.a, view.normal_area);
  // Also rejects NaN and triangles without area.
  if (!(std::fabs(view.triple) > PlaneError(view.normal_area, pd, q0))) return view;
  const Vec3d b = view.a + view.e1, c = view.a + view.e2;
  view.length_a = Length(view.a);
  view.length_b = Length(b);
  view.length_c = Length(c);
  const double denominator = view.length_a * view.length_b * view.length_c +
                             Dot(view.a, b) * view.length_c + Dot(b, c) * view.length_a +
                             Dot(c, view.a) * view.length_b;
  view.solid_angle = 2 * AngleOf(std::fabs(view.triple), denominator);
  view.visible = std::isfinite(denominator);
  view.by_area = !(view.solid_angle > kTriangleSolidAngleMin);
  return view;
}

namespace {

// Unit direction, uniform over the spherical triangle of the view.
Vec3d SampleSphericalTriangle(const TriangleView& view, Vec2f u) {
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

ShapePoint SampleTriangleByArea(const TriangleView& view, Vec3f v0, Vec2f u) {
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

}  // namespace

ShapePoint SampleTriangle(const TriangleView& view, Vec3f v0, Vec3f /*p*/, Vec2f u) {
  if (view.by_area) return SampleTriangleByArea(view, v0, u);
  const Vec3d w = SampleSphericalTriangle(view, u);
  // Intersection of the ray with the triangle. Source: Moeller and Trumbore 1997.
  const Vec3d p_cross = Cross(w, view.e2);
  const double scale = 1 / Dot(view.e1, p_cross);
  const double b1 = ClampToUnit(-Dot(view.a, p_cross) * scale);
  const double b2 = std::min(ClampToUnit(-Dot(w, Cross(view.a, view.e1)) * scale), 1 - b1);
  const Vec3d p_light = ToDouble(v0) + b1 * view.e1 + b2 * view.e2;
  return {w, p_light, Unit(view.normal_area)};
}

double PdfTriangle(const TriangleView& view, Vec3f p, Vec3f p_light) {
  if (!view.visible) return 0;
  if (!view.by_area) return 1 / view.solid_angle;
  // distance^2 / (cos * area), with cosine and area both from the triple product.
  const Vec3d l = ToDouble(p_light) - ToDouble(p);
  return 2 * LengthSquared(l) * Length(l) / std::fabs(view.triple);
}

SphereView ViewSphere(Vec3d center, double radius, bool from_inside, Vec3f p) {
  SphereView view;
  const Vec3d pd = ToDouble(p);
  view.to_center = center - pd;
  const double d_squared = LengthSquared(view.to_center);
  view.distance = std::sqrt(d_squared);
  if (!(radius > 0) || !std::isfinite(d_squared)) return view;
  view.visible = true;
  view.error = PlaneError({1, 1, 1}, pd, center);
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

namespace {

ShapePoint SampleSphereFromInside(const SphereView& view, Vec3d center, double radius, Vec2f u) {
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

}  // namespace

ShapePoint SampleSphere(const SphereView& view, Vec3d center, double radius, Vec2f u) {
  if (view.inside) return SampleSphereFromInside(view, center, radius, u);
  const Vec3d axis = view.to_center / view.distance;
  Vec3d t, b;
  MakeBasis(axis, &t, &b);
  const double one_minus_cos = static_cast<double>(u.x) * view.one_minus_cos_max;
  const double cos_theta = 1 - one_minus_cos;
  const double sin_squared = one_minus_cos * (1 + cos_theta);
  const double sin_theta = std::sqrt(sin_squared);
  const SinCosPair<double> phi = SinCosOf(2 * kPi * static_cast<double>(u.y));
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

DiskShapeView ViewDisk(Vec3d center, Vec3d normal, Vec3d axis_x, double radius, double inner_radius,
                       Vec3f p) {
  DiskShapeView view;
  const Vec3d pd = ToDouble(p);
  const Vec3d from_center = pd - center;
  view.normal = normal;
  view.radius = radius;
  view.inner_radius = inner_radius;
  view.height = Dot(normal, from_center);
  const bool has_area = radius > 0 && inner_radius < radius;
  if (!has_area || !(std::fabs(view.height) > PlaneError(normal, pd, center))) return view;
  view.foot = pd - view.height * normal;
  const Vec3d to_center = center - view.foot;
  view.offset = Length(to_center);
  view.visible = std::isfinite(view.offset);
  // Below double rounding the direction to the center is meaningless; any direction is valid.
  const bool centered = !(view.offset > 0x1p-40 * radius);
  view.axis_x = centered ? axis_x : to_center / view.offset;
  view.axis_y = Cross(normal, view.axis_x);
  view.by_area =
      LengthSquared(from_center) > kDiskPolarDistance * kDiskPolarDistance * radius * radius;
  view.phi_max = view.offset < radius
                     ? kPi
                     : AngleOf(radius, std::sqrt((view.offset - radius) * (view.offset + radius)));
  return view;
}

namespace {

// Part of the disk at one angle about the foot point, as distances and cosines at the receiver.
struct DiskChord {
  double one_minus_cos_near = 0;
  double cos_near = 0;
  double cos_range = 0;  // cos_near - cos_far.
};

DiskChord ChordAt(const DiskShapeView& view, double sin_phi, double cos_phi) {
  const double h = std::fabs(view.height);
  const double across = view.offset * sin_phi;
  const double half = std::sqrt(std::max((view.radius - across) * (view.radius + across), 0.0));
  const double middle = view.offset * cos_phi;
  const double far = std::max(middle + half, 0.0);
  const double near = view.offset < view.radius ? 0 : std::max(middle - half, 0.0);
  const double slant_near = std::sqrt(h * h + near * near);
  const double slant_far = std::sqrt(h * h + far * far);
  DiskChord chord;
  chord.cos_near = h / slant_near;
  chord.one_minus_cos_near = near * near / (slant_near * (slant_near + h));
  chord.cos_range =
      h * (far - near) * (far + near) / ((slant_near + slant_far) * slant_near * slant_far);
  return chord;
}

double DiskArea(const DiskShapeView& view) {
  return kPi * (view.radius - view.inner_radius) * (view.radius + view.inner_radius);
}

// Point of the plane at the given offset from the foot point.
ShapePoint DiskPoint(const DiskShapeView& view, Vec3d from_foot) {
  const Vec3d l = from_foot - view.height * view.normal;
  return {Unit(l), view.foot + from_foot, view.normal};
}

}  // namespace

ShapePoint SampleDisk(const DiskShapeView& view, Vec3f /*p*/, Vec2f u, bool* hit) {
  const Vec3d to_center = view.offset * view.axis_x;
  *hit = true;
  if (view.by_area) {
    const double inner_squared = view.inner_radius * view.inner_radius;
    const double r = std::sqrt(inner_squared + static_cast<double>(u.x) * (DiskArea(view) / kPi));
    const SinCosPair<double> phi = SinCosOf(2 * kPi * static_cast<double>(u.y));
    return DiskPoint(view, to_center + (r * phi.cos) * view.axis_x + (r * phi.sin) * view.axis_y);
  }
  const SinCosPair<double> phi = SinCosOf((2 * static_cast<double>(u.y) - 1) * view.phi_max);
  const DiskChord chord = ChordAt(view, phi.sin, phi.cos);
  const double step = static_cast<double>(u.x) * chord.cos_range;
  const double cos_theta = chord.cos_near - step;
  const double one_minus_cos = chord.one_minus_cos_near + step;
  const double rho =
      std::fabs(view.height) * std::sqrt(one_minus_cos * (1 + cos_theta)) / cos_theta;
  const Vec3d from_foot = (rho * phi.cos) * view.axis_x + (rho * phi.sin) * view.axis_y;
  *hit = LengthSquared(from_foot - to_center) >= view.inner_radius * view.inner_radius;
  return DiskPoint(view, from_foot);
}

double PdfDisk(const DiskShapeView& view, Vec3f p, Vec3f wi, Vec3f p_light) {
  if (!view.visible) return 0;
  if (view.by_area) {
    const Vec3d l = ToDouble(p_light) - ToDouble(p);
    return LengthSquared(l) * Length(l) / (std::fabs(view.height) * DiskArea(view));
  }
  const Vec3d w = ToDouble(wi);
  const double x = Dot(w, view.axis_x), y = Dot(w, view.axis_y);
  const double length = std::sqrt(x * x + y * y);
  const bool straight_down = !(length > 0);
  const DiskChord chord =
      straight_down ? ChordAt(view, 0, 1) : ChordAt(view, y / length, x / length);
  const double pdf = 1 / (2 * view.phi_max * chord.cos_range);
  return std::isfinite(pdf) ? pdf : 0;
}

}  // namespace sheaf::render
