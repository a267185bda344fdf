// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Where a path crosses the boundary of a medium, so that an edge of a mesh is crossed once.
#pragma once

#include <cmath>

#include "worker/render/geometry/ray_origin.h"
#include "worker/render/geometry/surface_point.h"

namespace sheaf::render {

// Space: render. n: unit geometric normal. Begins as one that no other is the same as.
struct Crossing {
  PrimitiveId id;
  Vec3f p, p_error, n;
  bool enters = false;
};

// Whether a crossing is the one before it, met once more. A ray goes through an edge by one of the
// two faces, and where it goes on, rounding may have it before the other. Then each of the points
// is in the plane of the other, as far as the bounds of both tell.
inline bool IsSameCrossing(const Crossing& crossing, const Crossing& last) {
  // Origins are moved by those bounds, and faces met with others.
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
