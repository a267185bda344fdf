// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Intersection of a ray with a quadric, inline for the tracer's callbacks: a distance that passes
// through an optional of another file waits for its own store. Numerics: quadric.h.
#pragma once

#include <cmath>
#include <utility>

#include "worker/render/geometry/quadric.h"

namespace sheaf::render {

// Whether a point of the whole quadric (object space) is on the part of a partial one.
bool IsOnPart(const Quadric& quadric, Vec3d p);

namespace internal {

// Spheres, and cylinders, which are circles for a ray projected along the axis (without z).
template <Quadric::Kind kKind>
inline double RoundHit(const Quadric& q, Vec3d object_o, Vec3d object_d, double t_max) {
  Vec3d o = object_o, d = object_d;
  if constexpr (kKind == Quadric::Kind::kCylinder) o.z = d.z = 0;
  const double dd = LengthSquared(d);
  const double od = -Dot(o, d);
  // The length of the perpendicular from the center to the line decides, not b^2 - 4ac. Rays along
  // a cylinder's axis have none.
  const Vec3d foot = o + d * (od / dd);
  const double below = q.radius * q.radius - LengthSquared(foot);
  if (!(below >= 0)) return 0;
  const double half_chord = std::sqrt(below * dd);
  const double sum = od + std::copysign(half_chord, od);
  // Two roots without cancellation: sum / dd and (|o|^2 - r^2) / sum, the latter factored.
  const double distance = Length(o);
  const double c = (distance - q.radius) * (distance + q.radius);
  double t0 = sum != 0 ? c / sum : 0, t1 = sum / dd;
  if (t0 > t1) std::swap(t0, t1);
  const auto is_hit = [&](double t) {
    return t > 0 && t < t_max && (!q.is_partial || IsOnPart(q, object_o + object_d * t));
  };
  return is_hit(t0) ? t0 : is_hit(t1) ? t1 : 0;
}

inline double DiskHit(const Quadric& q, Vec3d o, Vec3d d, double t_max) {
  if (d.z == 0) return 0;
  const double t = (q.z_min - o.z) / d.z;
  if (!(t > 0 && t < t_max)) return 0;
  const Vec3d p = o + d * t;
  if (p.x * p.x + p.y * p.y > q.radius * q.radius) return 0;
  return q.is_partial && !IsOnPart(q, p) ? 0 : t;
}

}  // namespace internal

// IntersectQuadric, with 0 where nothing is hit.
inline double QuadricHit(const Quadric& q, Vec3d o, Vec3d d, double t_max) {
  const Vec3d object_o = q.object_from_target.Point(o), object_d = q.object_from_target.Vector(d);
  switch (q.kind) {
    case Quadric::Kind::kSphere:
      return internal::RoundHit<Quadric::Kind::kSphere>(q, object_o, object_d, t_max);
    case Quadric::Kind::kCylinder:
      return internal::RoundHit<Quadric::Kind::kCylinder>(q, object_o, object_d, t_max);
    case Quadric::Kind::kDisk:
      break;
  }
  return internal::DiskHit(q, object_o, object_d, t_max);
}

}  // namespace sheaf::render
