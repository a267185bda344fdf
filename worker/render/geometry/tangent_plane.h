// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TangentPlane: the shading normal and tangents of a surface point, from which normal maps start.
#pragma once

#include <cmath>

#include "common/math/vec.h"

namespace sheaf::render {

// The tangent plane of a surface at a point, for normal and bump maps. Space: any; n and the result
// are in the same space.
struct TangentPlane {
  Vec3d n;                    // Unit: the shading normal.
  Vec3d dpdu, dpdv;           // By the texture coordinates uv. In a space with the world's axes.
  bool has_tangents = false;  // Otherwise there are no usable uvs.
  Vec3d own_tangent = {};     // The mesh's own tangent, of any length; zero without one.
};

// The direction at right angles to the unit normal n, not unit, from which anisotropy and normal
// maps count: that of the mesh's own tangent, else that of dpdu. Zero or not finite if there is
// none.
inline Vec3d TangentOf(const TangentPlane& plane, Vec3d n) {
  const auto across = [n](Vec3d v) { return v - n * Dot(n, v); };
  if (LengthSquared(plane.own_tangent) > 0) [[unlikely]] {
    const Vec3d own = across(plane.own_tangent);
    const double length = Length(own);
    if (length > 0 && std::isfinite(length)) return own;
  }
  return plane.has_tangents ? across(plane.dpdu) : Vec3d{0, 0, 0};
}

}  // namespace sheaf::render
