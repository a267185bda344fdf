// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Polar decomposition and interpolation of key frames.
#include "worker/render/geometry/animated_transform.h"

#include <algorithm>
#include <cmath>

#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

// Newton's iteration converges quadratically; any invertible matrix of double needs far fewer
// steps.
constexpr int kPolarIterationsMax = 100;
constexpr double kPolarTolerance = 1e-15;
constexpr double kAffineTolerance = 1e-9;
// Below this arc the normalized straight line between quaternions equals the arc in double.
constexpr double kStraightArc = 1e-7;

Affine Linear(const Affine& a) { return {a.x, a.y, a.z, {0, 0, 0}}; }

Affine Transposed(const Affine& a) {
  return {{a.x.x, a.y.x, a.z.x}, {a.x.y, a.y.y, a.z.y}, {a.x.z, a.y.z, a.z.z}, {0, 0, 0}};
}

Affine Blend(const Affine& a, double s, const Affine& b, double t) {
  return {a.x * s + b.x * t, a.y * s + b.y * t, a.z * s + b.z * t, {0, 0, 0}};
}

double FrobeniusNorm(const Affine& a) {
  return std::sqrt(LengthSquared(a.x) + LengthSquared(a.y) + LengthSquared(a.z));
}

// Returns the orthogonal factor nearest to a; keeps the sign of the determinant.
Affine PolarFactor(const Affine& a) {
  Affine q = Linear(a);
  for (int i = 0; i < kPolarIterationsMax; ++i) {
    const Affine inverse_transposed = Transposed(Inverse(q));
    // Scaling by the ratio of norms speeds up the first steps for stretched matrices.
    const double scale = std::sqrt(FrobeniusNorm(inverse_transposed) / FrobeniusNorm(q));
    const Affine next = Blend(q, 0.5 * scale, inverse_transposed, 0.5 / scale);
    const double change = FrobeniusNorm(Blend(next, 1, q, -1));
    q = next;
    if (change <= kPolarTolerance * FrobeniusNorm(q)) break;
  }
  return q;
}

bool IsFinite(Vec3d v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

}  // namespace

AnimatedTransform::Quaternion AnimatedTransform::QuaternionOf(const Affine& r) {
  // Takes the largest component from a square root, so that no division loses digits.
  // Source: Shepperd 1978.
  const double trace = r.x.x + r.y.y + r.z.z;
  if (trace >= r.x.x && trace >= r.y.y && trace >= r.z.z) {
    const double w = 0.5 * std::sqrt(std::max(0.0, 1 + trace));
    const double k = 0.25 / w;
    return {w, (r.y.z - r.z.y) * k, (r.z.x - r.x.z) * k, (r.x.y - r.y.x) * k};
  }
  if (r.x.x >= r.y.y && r.x.x >= r.z.z) {
    const double x = 0.5 * std::sqrt(std::max(0.0, 1 + r.x.x - r.y.y - r.z.z));
    const double k = 0.25 / x;
    return {(r.y.z - r.z.y) * k, x, (r.x.y + r.y.x) * k, (r.z.x + r.x.z) * k};
  }
  if (r.y.y >= r.z.z) {
    const double y = 0.5 * std::sqrt(std::max(0.0, 1 + r.y.y - r.x.x - r.z.z));
    const double k = 0.25 / y;
    return {(r.z.x - r.x.z) * k, (r.x.y + r.y.x) * k, y, (r.y.z + r.z.y) * k};
  }
  const double z = 0.5 * std::sqrt(std::max(0.0, 1 + r.z.z - r.x.x - r.y.y));
  const double k = 0.25 / z;
  return {(r.x.y - r.y.x) * k, (r.z.x + r.x.z) * k, (r.y.z + r.z.y) * k, z};
}

Affine AnimatedTransform::RotationOf(const Quaternion& q) {
  const double norm_squared = q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z;
  const double s = 2 / norm_squared;
  return {
      {1 - s * (q.y * q.y + q.z * q.z), s * (q.x * q.y + q.w * q.z), s * (q.x * q.z - q.w * q.y)},
      {s * (q.x * q.y - q.w * q.z), 1 - s * (q.x * q.x + q.z * q.z), s * (q.y * q.z + q.w * q.x)},
      {s * (q.x * q.z + q.w * q.y), s * (q.y * q.z - q.w * q.x), 1 - s * (q.x * q.x + q.y * q.y)},
      {0, 0, 0}};
}

absl::StatusOr<AnimatedTransform::Key> AnimatedTransform::MakeKey(const Matrix4& matrix) {
  Matrix4 inverse;
  if (!Invert(matrix, &inverse)) {
    return absl::InvalidArgumentError("a key of the motion is singular or not finite");
  }
  // A matrix that results from an inversion has a last row that is affine to rounding.
  const auto& last = matrix.m[3];
  const double deviation =
      std::fabs(last[0]) + std::fabs(last[1]) + std::fabs(last[2]) + std::fabs(last[3] - 1);
  if (!(deviation <= kAffineTolerance)) {
    return absl::InvalidArgumentError("a key of the motion is not affine");
  }
  Key key;
  key.transform = AffineOf(matrix);
  if (!IsFinite(key.transform.offset)) {
    return absl::InvalidArgumentError("a key of the motion is not finite");
  }
  key.translation = key.transform.offset;
  Affine rotation = PolarFactor(key.transform);
  // Moves a mirror to the stretch, so that the rotation is proper.
  if (rotation.Determinant() < 0) rotation = {-rotation.x, -rotation.y, -rotation.z, {0, 0, 0}};
  key.stretch = Transposed(rotation) * Linear(key.transform);
  key.rotation = QuaternionOf(rotation);
  return key;
}

absl::StatusOr<AnimatedTransform> AnimatedTransform::Make(const TransformOverTime& motion) {
  if (!(motion.end_time >= motion.start_time)) {
    return absl::InvalidArgumentError("the motion ends before it starts");
  }
  AnimatedTransform result;
  const Matrix4* matrices[2] = {&motion.start, &motion.end};
  for (int i = 0; i < 2; ++i) {
    absl::StatusOr<Key> key = MakeKey(*matrices[i]);
    if (!key.ok()) return key.status();
    result.keys_[i] = *key;
  }
  if ((result.keys_[0].transform.Determinant() < 0) !=
      (result.keys_[1].transform.Determinant() < 0)) {
    return absl::InvalidArgumentError("the motion mirrors its object halfway");
  }
  result.start_time_ = motion.start_time;
  result.end_time_ = motion.end_time;
  // q and -q are the same rotation; the nearer of the two gives the shorter arc.
  const Quaternion& a = result.keys_[0].rotation;
  Quaternion& b = result.keys_[1].rotation;
  if (a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z < 0) b = {-b.w, -b.x, -b.y, -b.z};
  const double apart = std::sqrt((a.w - b.w) * (a.w - b.w) + (a.x - b.x) * (a.x - b.x) +
                                 (a.y - b.y) * (a.y - b.y) + (a.z - b.z) * (a.z - b.z));
  const double together = std::sqrt((a.w + b.w) * (a.w + b.w) + (a.x + b.x) * (a.x + b.x) +
                                    (a.y + b.y) * (a.y + b.y) + (a.z + b.z) * (a.z + b.z));
  // Accurate near 0, where the arc cosine of the dot product is not (and the product may exceed 1).
  result.half_angle_ = 2 * Atan2(apart, together);
  return result;
}

double AnimatedTransform::KeyFraction(double time) const {
  if (time <= start_time_) return 0;
  if (time >= end_time_) return 1;
  return (time - start_time_) / (end_time_ - start_time_);
}

Affine AnimatedTransform::At(double time) const {
  const double s = KeyFraction(time);
  if (s == 0) return keys_[0].transform;
  if (s == 1) return keys_[1].transform;
  double weight_0 = 1 - s, weight_1 = s;
  if (half_angle_ > kStraightArc) {
    const double inverse_sine = 1 / Sin(half_angle_);
    weight_0 = Sin((1 - s) * half_angle_) * inverse_sine;
    weight_1 = Sin(s * half_angle_) * inverse_sine;
  }
  const Quaternion &a = keys_[0].rotation, &b = keys_[1].rotation;
  const Affine rotation =
      RotationOf({a.w * weight_0 + b.w * weight_1, a.x * weight_0 + b.x * weight_1,
                  a.y * weight_0 + b.y * weight_1, a.z * weight_0 + b.z * weight_1});
  Affine result = rotation * Blend(keys_[0].stretch, 1 - s, keys_[1].stretch, s);
  result.offset = keys_[0].translation * (1 - s) + keys_[1].translation * s;
  return result;
}

double AnimatedTransform::LinearDeviationMax(double time_0, double time_1, double radius) const {
  // A curve deviates from its chord by at most (duration^2 / 8) max |acceleration|. With x = R S p
  // and S linear in time, |x''| <= w^2 |S p| + 2 w |S' p|, where w is the angular speed.
  const double duration = KeyFraction(time_1) - KeyFraction(time_0);
  const double angular_speed = 2 * half_angle_;
  const double stretch = std::max(FrobeniusNorm(keys_[0].stretch), FrobeniusNorm(keys_[1].stretch));
  const double stretch_speed = FrobeniusNorm(Blend(keys_[1].stretch, 1, keys_[0].stretch, -1));
  const double acceleration =
      radius * angular_speed * (angular_speed * stretch + 2 * stretch_speed);
  double deviation = 0.125 * duration * duration * acceleration;
  // If the motion starts or ends within the interval, the path has a corner there.
  const bool has_corner =
      (time_0 < start_time_ && start_time_ < time_1) || (time_0 < end_time_ && end_time_ < time_1);
  if (has_corner) {
    const double speed = Length(keys_[1].translation - keys_[0].translation) +
                         radius * (angular_speed * stretch + stretch_speed);
    deviation += duration * speed;
  }
  return deviation;
}

}  // namespace sheaf::render
