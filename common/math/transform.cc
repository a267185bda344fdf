// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/transform.h"

#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "common/base/check.h"
#include "common/math/compensated.h"
#include "common/math/elementary.h"

namespace sheaf {
namespace {

constexpr size_t kSize = 4;

double MaxMagnitude(const Matrix4& a) {
  double largest = 0;
  for (const auto& row : a.m) {
    for (const double v : row) {
      if (!std::isfinite(v)) return std::numeric_limits<double>::infinity();
      largest = std::fmax(largest, std::fabs(v));
    }
  }
  return largest;
}

struct Pivot {
  size_t row, column;
  double magnitude;
};
// The largest element of the remaining part.
Pivot FindPivot(const Matrix4& a, size_t from) {
  Pivot best{from, from, 0};
  for (size_t r = from; r < kSize; ++r) {
    for (size_t c = from; c < kSize; ++c) {
      if (const double v = std::fabs(a.m[r][c]); v > best.magnitude) best = {r, c, v};
    }
  }
  return best;
}

// Makes column `pivot` of `left` a unit vector by row operations, applied to `right` too.
void EliminateColumn(size_t pivot, Matrix4* left, Matrix4* right) {
  const double scale = left->m[pivot][pivot];
  for (size_t c = 0; c < kSize; ++c) {
    left->m[pivot][c] /= scale;
    right->m[pivot][c] /= scale;
  }
  for (size_t r = 0; r < kSize; ++r) {
    const double factor = left->m[r][pivot];
    if (r == pivot || factor == 0) continue;
    for (size_t c = 0; c < kSize; ++c) {
      left->m[r][c] -= factor * left->m[pivot][c];
      right->m[r][c] -= factor * right->m[pivot][c];
    }
  }
}

// cos and sin of an angle in degrees, exact at multiples of 90.
SinCosPair<double> SinCosOfDegrees(double degrees) {
  const double turns = degrees / 360;
  const double within = degrees - 360 * std::floor(turns + 0.5);  // In [-180, 180].
  const double quarter = std::floor(within / 90 + 0.5);
  const SinCosPair<double> p = SinCos((within - 90 * quarter) * (kPi / 180));
  switch (static_cast<int>(quarter)) {
    case 0:
      return p;
    case 1:
      return {p.cos, -p.sin};
    case -1:
      return {-p.cos, p.sin};
    default:
      return {-p.sin, -p.cos};
  }
}

}  // namespace

Matrix4 operator*(const Matrix4& a, const Matrix4& b) {
  Matrix4 product;
  for (size_t r = 0; r < kSize; ++r) {
    for (size_t c = 0; c < kSize; ++c) {
      product.m[r][c] = a.m[r][0] * b.m[0][c] + a.m[r][1] * b.m[1][c] + a.m[r][2] * b.m[2][c] +
                        a.m[r][3] * b.m[3][c];
    }
  }
  return product;
}

Matrix4 Transpose(const Matrix4& a) {
  Matrix4 transposed;
  for (size_t r = 0; r < kSize; ++r) {
    for (size_t c = 0; c < kSize; ++c) transposed.m[c][r] = a.m[r][c];
  }
  return transposed;
}

double Determinant3(const Matrix4& a) {
  const auto& m = a.m;
  return m[0][0] * DifferenceOfProducts(m[1][1], m[2][2], m[1][2], m[2][1]) -
         m[0][1] * DifferenceOfProducts(m[1][0], m[2][2], m[1][2], m[2][0]) +
         m[0][2] * DifferenceOfProducts(m[1][0], m[2][1], m[1][1], m[2][0]);
}

// Gauss-Jordan elimination with full pivoting. Rows and columns are first scaled by powers of two,
// so that a scene in nanometers with a translation in kilometers is as accurate as one in meters.
bool Invert(const Matrix4& a, Matrix4* inverse) {
  if (!std::isfinite(MaxMagnitude(a))) return false;
  Matrix4 left = a, right;
  std::array<double, kSize> row_scale, column_scale;
  for (size_t r = 0; r < kSize; ++r) {
    double largest = 0;
    for (size_t c = 0; c < kSize; ++c) largest = std::fmax(largest, std::fabs(left.m[r][c]));
    if (largest == 0) return false;
    row_scale[r] = std::ldexp(1.0, -std::ilogb(largest));
    for (double& v : left.m[r]) v *= row_scale[r];
  }
  for (size_t c = 0; c < kSize; ++c) {
    double largest = 0;
    for (size_t r = 0; r < kSize; ++r) largest = std::fmax(largest, std::fabs(left.m[r][c]));
    if (largest == 0) return false;
    column_scale[c] = std::ldexp(1.0, -std::ilogb(largest));
    for (size_t r = 0; r < kSize; ++r) left.m[r][c] *= column_scale[c];
  }

  // A pivot this much smaller than the (scaled) elements is the rounding error of a singular
  // matrix.
  constexpr double kPivotMin = 16 * std::numeric_limits<double>::epsilon();
  std::array<size_t, kSize> source_column{0, 1, 2, 3};
  for (size_t step = 0; step < kSize; ++step) {
    const Pivot pivot = FindPivot(left, step);
    if (!(pivot.magnitude > kPivotMin)) return false;
    std::swap(left.m[step], left.m[pivot.row]);
    std::swap(right.m[step], right.m[pivot.row]);
    for (auto& row : left.m) std::swap(row[step], row[pivot.column]);
    std::swap(source_column[step], source_column[pivot.column]);
    EliminateColumn(step, &left, &right);
  }

  Matrix4 result;
  for (size_t r = 0; r < kSize; ++r) {
    const size_t target = source_column[r];
    for (size_t c = 0; c < kSize; ++c) {
      result.m[target][c] = right.m[r][c] * column_scale[target] * row_scale[c];
    }
  }
  if (!std::isfinite(MaxMagnitude(result))) return false;
  *inverse = result;
  return true;
}

Matrix4 TranslateMatrix(Vec3d offset) {
  Matrix4 a;
  a.m[0][3] = offset.x;
  a.m[1][3] = offset.y;
  a.m[2][3] = offset.z;
  return a;
}

Matrix4 ScaleMatrix(Vec3d factors) {
  Matrix4 a;
  a.m[0][0] = factors.x;
  a.m[1][1] = factors.y;
  a.m[2][2] = factors.z;
  return a;
}

// Rodrigues' formula.
Matrix4 RotateMatrix(double angle_degrees, Vec3d axis) {
  SHEAF_CHECK(LengthSquared(axis) > 0);
  const Vec3d u = Normalize(axis);
  const SinCosPair<double> angle = SinCosOfDegrees(angle_degrees);
  const double s = angle.sin, c = angle.cos, d = 1 - c;
  Matrix4 a;
  a.m[0] = {u.x * u.x * d + c, u.x * u.y * d - u.z * s, u.x * u.z * d + u.y * s, 0};
  a.m[1] = {u.x * u.y * d + u.z * s, u.y * u.y * d + c, u.y * u.z * d - u.x * s, 0};
  a.m[2] = {u.x * u.z * d - u.y * s, u.y * u.z * d + u.x * s, u.z * u.z * d + c, 0};
  return a;
}

bool LookAtMatrix(Vec3d eye, Vec3d at, Vec3d up, Matrix4* world_from_camera) {
  const Vec3d towards = at - eye;
  if (!(LengthSquared(towards) > 0) || !(LengthSquared(up) > 0)) return false;
  const Vec3d forward = Normalize(towards);
  const Vec3d sideways = CrossAccurate(Normalize(up), forward);
  // Parallel directions leave only rounding errors here.
  constexpr double kSineMin = 1e-14;
  if (!(Length(sideways) > kSineMin)) return false;
  const Vec3d right = Normalize(sideways);
  const Vec3d camera_up = Cross(forward, right);
  Matrix4 a;
  for (size_t i = 0; i < 3; ++i) a.m[i] = {right[i], camera_up[i], forward[i], eye[i]};
  if (!std::isfinite(MaxMagnitude(a))) return false;
  *world_from_camera = a;
  return true;
}

Vec3d TransformPoint(const Matrix4& a, Vec3d p) {
  std::array<double, kSize> h;
  for (size_t r = 0; r < kSize; ++r) {
    h[r] = a.m[r][0] * p.x + a.m[r][1] * p.y + a.m[r][2] * p.z + a.m[r][3];
  }
  const Vec3d q{h[0], h[1], h[2]};
  return h[3] == 1 ? q : q / h[3];
}

Vec3d TransformVector(const Matrix4& a, Vec3d v) {
  Vec3d q;
  for (size_t r = 0; r < 3; ++r) q[r] = a.m[r][0] * v.x + a.m[r][1] * v.y + a.m[r][2] * v.z;
  return q;
}

Vec3d TransformNormal(const Matrix4& inverse, Vec3d n) {
  Vec3d q;
  for (size_t c = 0; c < 3; ++c) {
    q[c] = inverse.m[0][c] * n.x + inverse.m[1][c] * n.y + inverse.m[2][c] * n.z;
  }
  return q;
}

}  // namespace sheaf
