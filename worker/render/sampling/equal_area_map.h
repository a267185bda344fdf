// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The equal-area octahedral map between the unit square and the sphere: equal areas on one are
// equal solid angles on the other (1 : 4 pi), so no direction is a pole. The center of the square
// is +z, its corners are -z; orientation as in pbrt-v4. Source: Clarberg 2008, "Fast Equal-Area
// Mapping of the (Hemi)Sphere using SIMD".
#pragma once

#include <algorithm>

#include "common/math/vec.h"

namespace sheaf::render {

// st: in [0, 1]^2. Returns a unit vector.
Vec3d EqualAreaSquareToSphere(Vec2d st);
// d: unit. Returns a point of [0, 1]^2.
Vec2f EqualAreaSphereToSquare(Vec3f d);

struct TexelPosition {
  int x = 0, y = 0;
};
// Maps a position at most one step outside a map of size x size texels to the texel that is its
// neighbor on the sphere: across an edge the map continues with the same edge mirrored about its
// middle.
inline TexelPosition WrapOctahedral(TexelPosition p, int size) {
  if (p.x < 0 || p.x >= size) p = {std::clamp(p.x, 0, size - 1), size - 1 - p.y};
  if (p.y < 0 || p.y >= size) p = {size - 1 - p.x, std::clamp(p.y, 0, size - 1)};
  return p;
}

}  // namespace sheaf::render
