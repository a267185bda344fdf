// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Directions from uniform numbers.
#pragma once

#include <cmath>

#include "common/math/elementary.h"
#include "common/math/vec.h"

namespace sheaf::render {

// Unit, uniform over the sphere. u: in [0, 1)^2.
inline Vec3f UniformDirection(Vec2f u) {
  const double z = 1 - 2 * static_cast<double>(u.x);
  const double r = std::sqrt(1 - z * z);
  const SinCosPair<double> phi = SinCos(2 * kPi * static_cast<double>(u.y));
  return ToFloat({r * phi.cos, r * phi.sin, z});
}

}  // namespace sheaf::render
