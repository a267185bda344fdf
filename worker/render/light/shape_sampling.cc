// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sampling of disks.
#include "worker/render/light/shape_sampling.h"

#include <algorithm>
#include <cmath>

namespace sheaf::render {

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
  if (!has_area || !(std::fabs(view.height) > internal::PlaneError(normal, pd, center)))
    return view;
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
  view.phi_max =
      view.offset < radius
          ? kPi
          : internal::AngleOf(radius, std::sqrt((view.offset - radius) * (view.offset + radius)));
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
  return {internal::Unit(l), view.foot + from_foot, view.normal};
}

}  // namespace

ShapePoint SampleDisk(const DiskShapeView& view, Vec3f /*p*/, Vec2f u, bool* hit) {
  const Vec3d to_center = view.offset * view.axis_x;
  *hit = true;
  if (view.by_area) {
    const double inner_squared = view.inner_radius * view.inner_radius;
    const double r = std::sqrt(inner_squared + static_cast<double>(u.x) * (DiskArea(view) / kPi));
    const SinCosPair<double> phi = internal::SinCosOf(2 * kPi * static_cast<double>(u.y));
    return DiskPoint(view, to_center + (r * phi.cos) * view.axis_x + (r * phi.sin) * view.axis_y);
  }
  const SinCosPair<double> phi =
      internal::SinCosOf((2 * static_cast<double>(u.y) - 1) * view.phi_max);
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
