// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Frame: an orthonormal basis about a direction, for shading and sampling.
#pragma once

#include <cmath>

#include "common/math/vec.h"

namespace sheaf {

// Right-handed orthonormal basis: Cross(t, b) == n. In its local space n is (0, 0, 1).
struct Frame {
  Vec3f t{1, 0, 0}, b{0, 1, 0}, n{0, 0, 1};

  Vec3f ToLocal(Vec3f world) const { return {Dot(world, t), Dot(world, b), Dot(world, n)}; }
  Vec3f ToWorld(Vec3f local) const { return local.x * t + local.y * b + local.z * n; }

  // Continuous in n except for a jump at n.z = 0 (the sign of -0 counts).
  // Requires: n is unit length. Source: Duff et al. 2017, "Building an Orthonormal Basis,
  // Revisited".
  static Frame FromNormal(Vec3f n) {
    const float sign = std::copysign(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float xy = n.x * n.y * a;
    return {
        {1.0f + sign * n.x * n.x * a, sign * xy, -sign * n.x}, {xy, sign + n.y * n.y * a, -n.y}, n};
  }
};

}  // namespace sheaf
