// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Crossing: a path's crossing of a medium boundary, compared so that a mesh edge is crossed once.
#pragma once

#include <cmath>

#include "worker/render/geometry/ray_origin.h"
#include "worker/render/geometry/surface_point.h"

namespace sheaf::render {

// Space: render. n: unit geometric normal. The default equals no other crossing.
struct Crossing {
  PrimitiveId id;
  Vec3f p, p_error, n;
  bool enters = false;
};

// Whether a crossing repeats the previous one. A ray through an edge hits one of its two faces;
// after the ray continues, rounding may place the other face ahead of it. Then each of the points
// lies in the other's plane, within the error bounds of both.
inline bool IsSameCrossing(const Crossing& crossing, const Crossing& last) {
  // Ray origins are offset by those bounds, and intersections have errors of their own.
  constexpr float kErrors = 16;
  const PrimitiveId &id = crossing.id, &before = last.id;
  if (crossing.enters != last.enters || id.geometry != before.geometry ||
      id.placed != before.placed) {
    return false;
  }
  const Vec3f between = crossing.p - last.p, errors = (crossing.p_error + last.p_error) * kErrors;
  const auto is_in_plane = [&](Vec3f n) {
    return std::fabs(Dot(n, between)) <= Dot(Abs(n), errors);
  };
  return is_in_plane(crossing.n) && is_in_plane(last.n);
}

}  // namespace sheaf::render
