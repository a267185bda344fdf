// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ChainRay: a ray of a chain of smooth interfaces, with its derivatives by the two coordinates of
// the direction in which the chain begins. Sources: Igehy 1999, "Tracing Ray Differentials"; Jakob
// and Marschner 2012, "Manifold Exploration".
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "common/math/vec.h"

namespace sheaf::render {

// Two unit vectors perpendicular to the unit vector d and to each other.
struct Perpendicular {
  Vec3d u, v;
  explicit Perpendicular(Vec3d d) {
    const Vec3d axis = std::fabs(d.x) < 0.5 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0};
    u = Normalize(Cross(d, axis));
    v = Cross(d, u);
  }
};

// Space: render. d: unit.
struct ChainRay {
  Vec3d p, d;
  std::array<Vec3d, 2> dp{}, dd{};

  ChainRay() = default;
  // Leaves p along d; the coordinates are those of d in Perpendicular(d), in radians.
  ChainRay(Vec3d from, Vec3d along) : p(from), d(along) {
    const Perpendicular plane(along);
    dd = {plane.u, plane.v};
  }

  // Moves to the point q, where it meets a surface with the unit normal ng.
  void MoveTo(Vec3d q, Vec3d ng) {
    const double t = Dot(q - p, d), cosine = Dot(d, ng);
    for (size_t i = 0; i < 2; ++i) {
      const Vec3d moved = dp[i] + dd[i] * t;
      dp[i] = moved - d * (Dot(moved, ng) / cosine);
    }
    p = q;
  }
  // n: the unit normal of the mirror, on either side; dn: how it turns with the coordinates.
  void Reflect(Vec3d n, const std::array<Vec3d, 2>& dn) {
    const double along = Dot(d, n);
    for (size_t i = 0; i < 2; ++i) {
      dd[i] = dd[i] - 2 * ((Dot(dd[i], n) + Dot(d, dn[i])) * n + along * dn[i]);
    }
    d = Normalize(d - 2 * along * n);
  }
  // eta: index of the far side over that of the near one. n, dn: as above. False under total
  // reflection.
  bool Refract(Vec3d n, const std::array<Vec3d, 2>& dn, double eta) {
    const double side = Dot(d, n) > 0 ? -1 : 1, mu = 1 / eta;
    const double cos_i = -side * Dot(d, n);
    const double cos_t_squared = 1 - mu * mu * (1 - cos_i * cos_i);
    if (!(cos_t_squared > 0)) return false;
    const double cos_t = std::sqrt(cos_t_squared), bend = mu * cos_i - cos_t;
    for (size_t i = 0; i < 2; ++i) {
      const double dcos_i = -side * (Dot(dd[i], n) + Dot(d, dn[i]));
      const double dbend = mu * dcos_i - mu * mu * cos_i * dcos_i / cos_t;
      dd[i] = mu * dd[i] + side * (dbend * n + bend * dn[i]);
    }
    d = Normalize(mu * d + side * bend * n);
    return true;
  }
};

// By how much a ray misses a point in front of it, in a plane through the point.
struct ChainMiss {
  double u = 0, v = 0;
  // Derivatives of u and v by the two coordinates, and their determinant: the area of the plane
  // that a solid angle of beginnings covers at the point.
  std::array<double, 2> du{}, dv{};
  double determinant = 0;

  double Distance() const { return std::hypot(u, v); }
  // The change of the coordinates after which the ray meets the point, but for second order.
  std::array<double, 2> Step() const {
    return {(v * du[1] - u * dv[1]) / determinant, (u * dv[0] - v * du[0]) / determinant};
  }
};
// n: the unit normal of the plane. None where the ray does not meet the plane, or its beginnings
// cover no area.
inline std::optional<ChainMiss> MissOf(const ChainRay& ray, Vec3d point, Vec3d n) {
  const double cosine = Dot(ray.d, n), t = Dot(point - ray.p, n) / cosine;
  if (!(t > 0) || !std::isfinite(t)) return std::nullopt;
  const Vec3d off = ray.p + ray.d * t - point;
  const Perpendicular plane(n);
  ChainMiss miss{.u = Dot(off, plane.u), .v = Dot(off, plane.v)};
  for (size_t i = 0; i < 2; ++i) {
    Vec3d moved = ray.dp[i] + ray.dd[i] * t;
    moved = moved - ray.d * (Dot(moved, n) / cosine);
    miss.du[i] = Dot(moved, plane.u);
    miss.dv[i] = Dot(moved, plane.v);
  }
  miss.determinant = miss.du[0] * miss.dv[1] - miss.du[1] * miss.dv[0];
  if (!(std::fabs(miss.determinant) > 0) || !std::isfinite(miss.determinant)) return std::nullopt;
  return miss;
}

}  // namespace sheaf::render
