// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Affine (and, for cameras, projective) transforms as 4x4 matrices of double with their inverses.
// Named target_from_source where they are used: p_world = world_from_object.Point(p_object).
#pragma once

#include <array>

#include "common/math/vec.h"

namespace sheaf {

// Row-major: m[row][column], points are columns.
struct Matrix4 {
  std::array<std::array<double, 4>, 4> m{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}};
  friend bool operator==(const Matrix4&, const Matrix4&) = default;
};

Matrix4 operator*(const Matrix4& a, const Matrix4& b);
Matrix4 Transpose(const Matrix4& a);
// Determinant of the upper-left 3x3 block; negative if handedness flips.
double Determinant3(const Matrix4& a);
// Returns false (and leaves *inverse unchanged) if the matrix is singular or not finite.
bool Invert(const Matrix4& a, Matrix4* inverse);

Matrix4 TranslateMatrix(Vec3d offset);
Matrix4 ScaleMatrix(Vec3d factors);
// Rotation by angle_degrees about axis, counter-clockwise if the axis points at the viewer.
// Requires: axis is not the zero vector.
Matrix4 RotateMatrix(double angle_degrees, Vec3d axis);
// world_from_camera of a left-handed camera at eye looking at `at` along +z. False if degenerate.
bool LookAtMatrix(Vec3d eye, Vec3d at, Vec3d up, Matrix4* world_from_camera);

Vec3d TransformPoint(const Matrix4& a, Vec3d p);   // Divides by w if the last row is projective.
Vec3d TransformVector(const Matrix4& a, Vec3d v);  // Ignores translation.
// Transforms a normal by the inverse transpose; takes the INVERSE of the point transform.
Vec3d TransformNormal(const Matrix4& inverse, Vec3d n);

}  // namespace sheaf
