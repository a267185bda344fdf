// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Affine: a 3x4 matrix of double for the tracing kernels, which transform rays into objects cheaply
// and accurately: instances keep doubles, so float error enters once, at the final rounding.
#pragma once

#include "common/math/transform.h"
#include "common/math/vec.h"

namespace sheaf::render {

// Columns: images of the axes, then the image of the origin.
struct Affine {
  Vec3d x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, offset{0, 0, 0};

  Vec3d Point(Vec3d p) const { return p.x * x + p.y * y + p.z * z + offset; }
  Vec3d Vector(Vec3d v) const { return v.x * x + v.y * y + v.z * z; }
  // Applies the transpose of the linear part, unnormalized: called on object_from_world, it
  // transforms an object's normal to the world.
  Vec3d TransposedVector(Vec3d n) const { return {Dot(x, n), Dot(y, n), Dot(z, n)}; }
  double Determinant() const { return Dot(x, Cross(y, z)); }
};

// Drops the last row. Requires: it is (0, 0, 0, 1).
inline Affine AffineOf(const Matrix4& a) {
  const auto& m = a.m;
  return {{m[0][0], m[1][0], m[2][0]},
          {m[0][1], m[1][1], m[2][1]},
          {m[0][2], m[1][2], m[2][2]},
          {m[0][3], m[1][3], m[2][3]}};
}
// Requires: a.Determinant() is neither 0 nor too small for its inverse.
inline Affine Inverse(const Affine& a) {
  const double scale = 1.0 / a.Determinant();
  const Vec3d row_x = Cross(a.y, a.z) * scale;
  const Vec3d row_y = Cross(a.z, a.x) * scale;
  const Vec3d row_z = Cross(a.x, a.y) * scale;
  Affine inverse{{row_x.x, row_y.x, row_z.x},
                 {row_x.y, row_y.y, row_z.y},
                 {row_x.z, row_y.z, row_z.z},
                 {0, 0, 0}};
  inverse.offset = -inverse.Vector(a.offset);
  return inverse;
}
inline Affine operator*(const Affine& a, const Affine& b) {
  return {a.Vector(b.x), a.Vector(b.y), a.Vector(b.z), a.Point(b.offset)};
}

}  // namespace sheaf::render
