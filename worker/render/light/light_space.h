// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Linear maps between render space and the space of a light, as the rows of light_from_render.
#pragma once

#include "common/math/vec.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

inline Vec3f Rotate(const Vec3f (&rows)[3], Vec3f v) {
  return {Dot(rows[0], v), Dot(rows[1], v), Dot(rows[2], v)};
}
// Requires: the rows are those of a rotation.
inline Vec3d RotateBack(const Vec3f (&rows)[3], Vec3d v) {
  return v.x * ToDouble(rows[0]) + v.y * ToDouble(rows[1]) + v.z * ToDouble(rows[2]);
}
inline Affine AffineOf(const Vec3f (&rows)[3]) {
  const Vec3d x = ToDouble(rows[0]), y = ToDouble(rows[1]), z = ToDouble(rows[2]);
  return {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}, {}};
}

}  // namespace sheaf::render
