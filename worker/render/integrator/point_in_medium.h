// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PointInMedium: points of a ray in a medium, kept on the right side of nearby surfaces.
#pragma once

#include <algorithm>

#include "worker/render/geometry/surface_point.h"
#include "worker/render/integrator/context.h"

namespace sheaf::render {

// Bound of the error of a surface point along its normal.
inline float ErrorAlongNormal(const SurfacePoint& point) {
  const Vec3f n = Abs(point.ng);
  return std::max(Dot(n, point.p_error), Gamma(2) * Dot(n, Abs(point.p)));
}

// p, moved to the plane's side if rounding put it behind the plane.
inline Vec3f KeepOnSide(const NearPlane& plane, Vec3f p) {
  // Points within this many error bounds behind a surface were put there by rounding.
  constexpr double kReach = 8;
  const Vec3f n = Abs(plane.n);
  const double bound = static_cast<double>(Gamma(2)) * (Dot(ToDouble(n), ToDouble(Abs(p))) +
                                                        Dot(ToDouble(n), ToDouble(Abs(plane.p))));
  const double distance = Dot(ToDouble(p) - ToDouble(plane.p), ToDouble(plane.n));
  if (distance >= bound || distance < -kReach * bound) return p;
  return ToFloat(ToDouble(p) + ToDouble(plane.n) * (bound - distance));
}

// The point at t (in lengths of ray.d) before the hit (null: none). *near: the surface that the ray
// leaves; becomes that of the hit if the point is close to it.
template <typename C>
Vec3f PointInMedium(const Context<C>& c, const Ray& ray, const RawHit* hit, double t,
                    NearPlane* near) {
  Vec3f p = ToFloat(ToDouble(ray.o) + ToDouble(ray.d) * t);
  if (near->is_set) p = KeepOnSide(*near, p);
  if (hit == nullptr) return p;
  // Rounding matters only next to a surface. Grazing rays are next to it for longer.
  constexpr double kNearness = 0x1p-8;
  const double ahead = static_cast<double>(hit->t) - t;
  const Vec3f o = Abs(ray.o);
  const double size = static_cast<double>(std::max(o.x, std::max(o.y, o.z))) +
                      static_cast<double>(hit->t) * Length(ToDouble(ray.d));
  if (ahead * Length(ToDouble(ray.d)) > kNearness * size) return p;
  const SurfacePoint point = MakeSurfacePoint<C::kTraits>(c.scene.geometry, ray, *hit);
  *near = {point.p, Dot(ray.d, point.ng) > 0 ? -point.ng : point.ng, true};
  if constexpr (C::kSubsurface) near->p_error = ErrorAlongNormal(point);
  return KeepOnSide(*near, p);
}

}  // namespace sheaf::render
