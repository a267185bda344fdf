// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AnimatedTransform: where something is at any time between two key frames. Each key is split as
// M = T R S (translation, rotation, symmetric stretch); T and S move linearly, R along the shorter
// arc. Source: Shoemake and Duff 1992, "Matrix Animation and Polar Decomposition"; the polar part
// by Higham's scaled Newton iteration (1986). All in double.
#pragma once

#include <array>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

class AnimatedTransform {
 public:
  // target_from_world is applied after the motion, without being interpolated.
  // Errors: kInvalidArgument where a key is singular, not finite or not affine, where the two keys
  // differ in handedness, or where end_time is before start_time.
  static absl::StatusOr<AnimatedTransform> Make(const TransformOverTime& motion);

  // The transform at a time in the scene's time units; held still outside the keys. The keys
  // themselves are returned as they were given.
  Affine At(double time) const;

  // Bound of how far any point within |p| <= radius strays, between two times, from the straight
  // line between its places at these two times. In target units.
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
  double half_angle_ = 0;  // Of the arc between the two quaternions, in [0, pi / 2].
};

}  // namespace sheaf::render
