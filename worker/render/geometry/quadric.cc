// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Intersection and parametrization of spheres, cylinders and disks in double.
#include "worker/render/geometry/quadric.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/math/elementary.h"
#include "common/math/next_float.h"
#include "worker/render/geometry/quadric_hit.h"

namespace sheaf::render {
namespace {

constexpr double kTwoPi = 2 * std::numbers::pi;

double AzimuthOf(double x, double y) {
  const double phi = Atan2(y, x);
  return phi < 0 ? phi + kTwoPi : phi;
}

QuadricParameters SphereParameters(const Quadric& q, Vec3d p) {
  const double rho = std::sqrt(p.x * p.x + p.y * p.y);
  const double cos_phi = rho > 0 ? p.x / rho : 1, sin_phi = rho > 0 ? p.y / rho : 0;
  const double theta = Atan2(rho, p.z);
  const double theta_z_min = Acos(std::clamp(q.z_min / q.radius, -1.0, 1.0));
  const double theta_z_max = Acos(std::clamp(q.z_max / q.radius, -1.0, 1.0));
  const double theta_range = theta_z_max - theta_z_min;
  // At the poles u does not move the point; any length is valid.
  const double rho_tangent = rho > 0 ? rho : q.radius;
  return {{static_cast<float>(AzimuthOf(p.x, p.y) / q.phi_max),
           static_cast<float>((theta - theta_z_min) / theta_range)},
          Vec3d{-sin_phi, cos_phi, 0} * (q.phi_max * rho_tangent),
          Vec3d{p.z * cos_phi, p.z * sin_phi, -rho} * theta_range};
}

QuadricParameters DiskParameters(const Quadric& q, Vec3d p) {
  const double rho = std::sqrt(p.x * p.x + p.y * p.y);
  const double cos_phi = rho > 0 ? p.x / rho : 1, sin_phi = rho > 0 ? p.y / rho : 0;
  const double ring = q.radius - q.inner_radius;
  return {{static_cast<float>(AzimuthOf(p.x, p.y) / q.phi_max),
           static_cast<float>((q.radius - rho) / ring)},
          Vec3d{-sin_phi, cos_phi, 0} * (q.phi_max * (rho > 0 ? rho : q.radius)),
          Vec3d{cos_phi, sin_phi, 0} * -ring};
}

QuadricParameters CylinderParameters(const Quadric& q, Vec3d p) {
  const double height = q.z_max - q.z_min;
  return {{static_cast<float>(AzimuthOf(p.x, p.y) / q.phi_max),
           static_cast<float>((p.z - q.z_min) / height)},
          Vec3d{-p.y, p.x, 0} * q.phi_max,
          Vec3d{0, 0, height}};
}

}  // namespace

bool IsOnPart(const Quadric& q, Vec3d p) {
  if (q.kind == Quadric::Kind::kDisk) {
    if (p.x * p.x + p.y * p.y < q.inner_radius * q.inner_radius) return false;
  } else if (p.z < q.z_min || p.z > q.z_max) {
    return false;
  }
  return q.phi_max >= kTwoPi || AzimuthOf(p.x, p.y) <= q.phi_max;
}

std::optional<double> IntersectQuadric(const Quadric& q, Vec3d o, Vec3d d, double t_max) {
  const double t = QuadricHit(q, o, d, t_max);
  return t > 0 ? std::optional(t) : std::nullopt;
}

QuadricPoint QuadricPointAt(const Quadric& q, Vec3d o, Vec3d d, double t) {
  Vec3d p = q.object_from_target.Point(o + d * t);
  Vec3d n{0, 0, 1};
  if (q.kind == Quadric::Kind::kSphere) {
    p = p * (q.radius / Length(p));
    n = p;
  } else if (q.kind == Quadric::Kind::kCylinder) {
    n = Normalize(Vec3d{p.x, p.y, 0});
    p = {n.x * q.radius, n.y * q.radius, std::clamp(p.z, q.z_min, q.z_max)};
  } else {
    p.z = q.z_min;
  }
  return {q.target_from_object.Point(p), Normalize(q.object_from_target.TransposedVector(n)), p};
}

QuadricParameters QuadricParametersAt(const Quadric& q, Vec3d p_object) {
  QuadricParameters parameters;
  switch (q.kind) {
    case Quadric::Kind::kSphere:
      parameters = SphereParameters(q, p_object);
      break;
    case Quadric::Kind::kDisk:
      parameters = DiskParameters(q, p_object);
      break;
    case Quadric::Kind::kCylinder:
      parameters = CylinderParameters(q, p_object);
      break;
  }
  parameters.dpdu = q.target_from_object.Vector(parameters.dpdu);
  parameters.dpdv = q.target_from_object.Vector(parameters.dpdv);
  return parameters;
}

std::array<Vec3f, 2> QuadricBounds(const Quadric& q) {
  const Affine& m = q.target_from_object;
  const bool is_sphere = q.kind == Quadric::Kind::kSphere;
  // A sphere has one center; a cylinder lies between two circles, a disk within one.
  const Vec3d low = is_sphere ? m.offset : m.Point({0, 0, q.z_min});
  const Vec3d high = is_sphere ? m.offset : m.Point({0, 0, q.z_max});
  std::array<Vec3f, 2> bounds;
  for (size_t i = 0; i < 3; ++i) {
    // Support of the transformed ball (or circle) along axis i.
    const double z = is_sphere ? m.z[i] : 0;
    const double extent = q.radius * std::sqrt(m.x[i] * m.x[i] + m.y[i] * m.y[i] + z * z);
    bounds[0][i] = NextDown(static_cast<float>(std::min(low[i], high[i]) - extent));
    bounds[1][i] = NextUp(static_cast<float>(std::max(low[i], high[i]) + extent));
  }
  return bounds;
}

Vec3f QuadricCoordinateMax(const Quadric& q, const std::array<Vec3f, 2>& bounds) {
  Vec3f largest;
  for (size_t i = 0; i < 3; ++i) {
    // If the offset cancels a large z, its rounding remains.
    const double z =
        std::fabs(q.target_from_object.z[i]) * std::max(std::fabs(q.z_min), std::fabs(q.z_max));
    const auto way = static_cast<float>(std::max(z, std::fabs(q.target_from_object.offset[i])));
    largest[i] = std::max(way, std::max(std::fabs(bounds[0][i]), std::fabs(bounds[1][i])));
  }
  return largest;
}

namespace {

double PhiMax(float degrees) {
  if (degrees >= 360) return 2 * std::numbers::pi;
  return std::max(0.0, static_cast<double>(degrees)) * (std::numbers::pi / 180);
}

}  // namespace

Quadric MakeQuadric(const SphereShape& sphere) {
  Quadric q;
  q.kind = Quadric::Kind::kSphere;
  q.radius = std::fabs(static_cast<double>(sphere.radius));
  q.z_min = std::clamp<double>(std::min(sphere.z_min, sphere.z_max), -q.radius, q.radius);
  q.z_max = std::clamp<double>(std::max(sphere.z_min, sphere.z_max), -q.radius, q.radius);
  q.phi_max = PhiMax(sphere.phi_max_degrees);
  q.is_partial = q.z_min > -q.radius || q.z_max < q.radius || sphere.phi_max_degrees < 360;
  return q;
}

Quadric MakeQuadric(const DiskShape& disk) {
  Quadric q;
  q.kind = Quadric::Kind::kDisk;
  q.radius = disk.radius;
  q.z_min = q.z_max = disk.height;
  q.inner_radius = disk.inner_radius;
  q.phi_max = PhiMax(disk.phi_max_degrees);
  q.is_partial = disk.inner_radius > 0 || disk.phi_max_degrees < 360;
  return q;
}

Quadric MakeQuadric(const CylinderShape& cylinder) {
  Quadric q;
  q.kind = Quadric::Kind::kCylinder;
  q.radius = cylinder.radius;
  q.z_min = std::min(cylinder.z_min, cylinder.z_max);
  q.z_max = std::max(cylinder.z_min, cylinder.z_max);
  q.phi_max = PhiMax(cylinder.phi_max_degrees);
  q.is_partial = true;  // It has ends.
  return q;
}

}  // namespace sheaf::render
