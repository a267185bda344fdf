// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AnimatedTransform: a transform interpolated between two key frames. Each key is split as M = T R
// S (translation, rotation, symmetric stretch); T and S are interpolated linearly, R along the
// shorter arc. Source: Shoemake and Duff 1992, "Matrix Animation and Polar Decomposition"; the
// polar part by Higham's scaled Newton iteration (1986). All in double.
#pragma once

#include <array>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

class AnimatedTransform {
 public:
  // target_from_world is applied after the motion, without interpolation.
  // Errors: kInvalidArgument where a key is singular, not finite or not affine, where the two keys
  // differ in handedness, or where end_time is before start_time.
  static absl::StatusOr<AnimatedTransform> Make(const TransformOverTime& motion);

  // The transform at a time in the scene's time units; constant outside the keys. At the keys it
  // returns the given matrices exactly.
  Affine At(double time) const;

  // Upper bound of the distance, in target units, between the path of any point with |p| <= radius
  // and the straight line between its positions at the two times.
  double LinearDeviationMax(double time_0, double time_1, double radius) const;

 private:
  struct Quaternion {
    double w = 1, x = 0, y = 0, z = 0;
  };
  struct Key {
    Affine transform;
    Vec3d translation;
    Quaternion rotation;
    Affine stretch;  // Symmetric; its offset is zero.
  };
  static absl::StatusOr<Key> MakeKey(const Matrix4& matrix);
  static Quaternion QuaternionOf(const Affine& rotation);
  static Affine RotationOf(const Quaternion& q);
  double KeyFraction(double time) const;

  std::array<Key, 2> keys_;
  double start_time_ = 0, end_time_ = 1;
  double half_angle_ = 0;  // Half the arc between the two quaternions, in [0, pi / 2].
};

}  // namespace sheaf::render
