// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PointInMedium: points of a ray in a medium, kept on the right side of nearby surfaces.
//
// Rays start at rounded points. Where a free path is not long against the rounding, in a dense
// medium that is seen from afar, the path also keeps its exact place, as a point of the nearest
// surface and an offset in double, and measures from there how far that surface is: ExactLength and
// ExactPointInMedium. See docs/adr/0100-dense-media-by-offsets.md.
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

// A point is near a surface ahead, whose rounding matters, up to this part of its coordinates and
// of the distance. Grazing rays are near it for longer.
inline constexpr double kSurfaceNearness = 0x1p-8;

// The point at t (in lengths of ray.d) before the hit (null: none). *near: the surface that the ray
// leaves; becomes that of the hit if the point is close to it.
template <typename C>
Vec3f PointInMedium(const Context<C>& c, const Ray& ray, const RawHit* hit, double t,
                    NearPlane* near) {
  Vec3f p = ToFloat(ToDouble(ray.o) + ToDouble(ray.d) * t);
  if (near->is_set) p = KeepOnSide(*near, p);
  if (hit == nullptr) return p;
  const double ahead = static_cast<double>(hit->t) - t;
  const Vec3f o = Abs(ray.o);
  const double size = static_cast<double>(std::max(o.x, std::max(o.y, o.z))) +
                      static_cast<double>(hit->t) * Length(ToDouble(ray.d));
  if (ahead * Length(ToDouble(ray.d)) > kSurfaceNearness * size) return p;
  const SurfacePoint point = MakeSurfacePoint<C::kTraits>(c.scene.geometry, ray, *hit);
  *near = {point.p, Dot(ray.d, point.ng) > 0 ? -point.ng : point.ng, true};
  if constexpr (C::kSubsurface) near->p_error = ErrorAlongNormal(point);
  return KeepOnSide(*near, p);
}

// Whether the free paths of the homogeneous media are so short that the rounding of the ray's
// origin matters: beyond this many of them between the origin of the space and that of the ray.
inline constexpr float kFreePathsMax = 0x1p10f;
template <typename C>
bool NeedsExactPlace(const MediumState<C>& media, const Ray& ray) {
  if (!media.near.is_set || !media.properties.scatters) return false;
  if (media.properties.is_heterogeneous || media.properties.is_subsurface) return false;
  const Vec3f o = Abs(ray.o);
  return MaxComponent(media.properties.sigma_t) * std::max(o.x, std::max(o.y, o.z)) > kFreePathsMax;
}

// Where the ray's origin is, minus the point of the plane.
inline Vec3d OffsetFrom(const NearPlane& near, const Ray& ray) {
  return near.has_offset ? near.offset : ToDouble(ray.o) - ToDouble(near.p);
}

// The length of a segment that is `length` from the rounded origin of the ray to what it hits.
inline double ExactLength(const NearPlane& near, const Ray& ray, double length) {
  // The reach of points next to the plane, in roundings of their coordinates.
  constexpr double kReach = 64;
  const Vec3d n = ToDouble(near.n), d = Normalize(ToDouble(ray.d));
  const double descent = -Dot(n, d);
  if (!(descent > 0)) return length;
  const double to_plane = std::max(0.0, Dot(OffsetFrom(near, ray), n)) / descent;
  const Vec3d p = ToDouble(Abs(near.p));
  const double bound = kReach * static_cast<double>(Gamma(1)) * std::max(p.x, std::max(p.y, p.z));
  return std::fabs(to_plane - length) * descent <= bound ? to_plane : length;
}

// As PointInMedium, at `distance` from the exact origin of the ray. length: that of the segment by
// ExactLength, infinite without a hit.
template <typename C>
Vec3f ExactPointInMedium(const Context<C>& c, const Ray& ray, const RawHit* hit, double distance,
                         double length, NearPlane* near) {
  const double unit = Length(ToDouble(ray.d));
  const Vec3d offset = OffsetFrom(*near, ray) + ToDouble(ray.d) * (distance / unit);
  const bool meets_plane =
      hit != nullptr && length != static_cast<double>(hit->t) * unit;  // It replaced the length.
  if (meets_plane || hit == nullptr) {
    near->offset = offset;
    near->has_offset = true;
    return KeepOnSide(*near, ToFloat(ToDouble(near->p) + offset));
  }
  const Vec3d exact = ToDouble(near->p) + offset;
  const Vec3f p = PointInMedium(c, ray, hit, distance / unit, near);
  near->offset = exact - ToDouble(near->p);
  near->has_offset = true;
  return p;
}

}  // namespace sheaf::render
