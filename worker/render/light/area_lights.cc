// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/area_lights.h"

#include <algorithm>
#include <cmath>

#include "common/math/elementary.h"
#include "worker/render/sampling/directions.h"

namespace sheaf::render {
namespace {

// Bounds of an emitter that is never chosen: no area, or values no sample may carry.
LightBounds NoLight() { return {.kind = LightBounds::Kind::kPlanar, .strength = 0}; }

template <typename Emitter>
double PowerOf(const Emitter& emitter) {
  const double area = emitter.Area();
  const double sides = emitter.two_sided ? 2 : 1;
  return area > 0 ? kPi * area * sides * static_cast<double>(StrengthOf(emitter.radiance.rgb))
                  : 0.0;
}

}  // namespace

// --- Triangles ---------------------------------------------------------------------------------

double TriangleEmitter::Area() const {
  const Vec3d origin = ToDouble(v0);
  return 0.5 * Length(Cross(ToDouble(v1) - origin, ToDouble(v2) - origin));
}

ShapePoint TriangleEmitter::SampleArea(Vec2f u) const {
  const Vec3d origin = ToDouble(v0), e1 = ToDouble(v1) - origin, e2 = ToDouble(v2) - origin;
  const double root = std::sqrt(static_cast<double>(u.x));
  const double b2 = static_cast<double>(u.y) * root;
  return {{}, origin + (root - b2) * e1 + b2 * e2, Normalize(Cross(e1, e2))};
}

LightBounds TriangleEmitter::Bounds(const LightMaps&) const {
  const Vec3d origin = ToDouble(v0), e1 = ToDouble(v1) - origin, e2 = ToDouble(v2) - origin;
  const Vec3d normal = Cross(e1, e2);
  const double doubled_area = Length(normal);
  if (!(doubled_area > 0) || !std::isfinite(doubled_area)) return NoLight();
  const Vec3d center = origin + (e1 + e2) / 3.0;
  const double radius = std::max(
      {Length(origin - center), Length(origin + e1 - center), Length(origin + e2 - center)});
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = two_sided,
          .center = ToFloat(center),
          .normal = ToFloat(normal / doubled_area),
          .radius = static_cast<float>(radius),
          .area = static_cast<float>(0.5 * doubled_area),
          .strength = StrengthOf(radiance.rgb)};
}

double TriangleEmitter::Power(const LightMaps&, double) const { return PowerOf(*this); }

// --- Spheres -----------------------------------------------------------------------------------

double SphereEmitter::Area() const { return 4 * kPi * radius * radius; }

ShapePoint SphereEmitter::SampleArea(Vec2f u) const {
  const Vec3d n = Normalize(ToDouble(UniformDirection(u)));
  return {{}, center + radius * n, n};
}

LightBounds SphereEmitter::Bounds(const LightMaps&) const {
  const double silhouette = kPi * radius * radius;
  if (!(radius > 0) || !std::isfinite(silhouette) || !std::isfinite(LengthSquared(center))) {
    return NoLight();
  }
  return {.kind = LightBounds::Kind::kSphere,
          .center = ToFloat(center),
          .radius = static_cast<float>(radius),
          .area = static_cast<float>(silhouette),
          .strength = StrengthOf(radiance.rgb)};
}

double SphereEmitter::Power(const LightMaps&, double) const { return PowerOf(*this); }

// --- Disks -------------------------------------------------------------------------------------

double DiskEmitter::Area() const { return kPi * (radius - inner_radius) * (radius + inner_radius); }

ShapePoint DiskEmitter::SampleArea(Vec2f u) const {
  const double inner_squared = inner_radius * inner_radius;
  const double r =
      std::sqrt(inner_squared + static_cast<double>(u.x) * (radius * radius - inner_squared));
  const SinCosPair<double> phi = SinCos(2 * kPi * static_cast<double>(u.y));
  return {{}, center + (r * phi.cos) * axis_x + (r * phi.sin) * Cross(normal, axis_x), normal};
}

LightBounds DiskEmitter::Bounds(const LightMaps&) const {
  const double area = Area();
  if (!(area > 0) || !std::isfinite(area) || !std::isfinite(LengthSquared(center))) {
    return NoLight();
  }
  return {.kind = LightBounds::Kind::kPlanar,
          .two_sided = two_sided,
          .center = ToFloat(center),
          .normal = ToFloat(normal),
          .radius = static_cast<float>(radius),
          .area = static_cast<float>(area),
          .strength = StrengthOf(radiance.rgb)};
}

double DiskEmitter::Power(const LightMaps&, double) const { return PowerOf(*this); }

}  // namespace sheaf::render
