// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The equal-area octahedral map between the unit square and the sphere: equal areas on one are
// equal solid angles on the other (1 : 4 pi), so no direction is a pole. The centre of the square
// is +z, its corners are -z; orientation as in pbrt-v4. Source: Clarberg 2008, "Fast Equal-Area
// Mapping of the (Hemi)Sphere using SIMD".
#pragma once

#include "common/math/vec.h"

namespace sheaf::render {

// st: in [0, 1]^2. Returns a unit vector.
Vec3d EqualAreaSquareToSphere(Vec2d st);
// d: unit. Returns a point of [0, 1]^2.
Vec2f EqualAreaSphereToSquare(Vec3f d);

}  // namespace sheaf::render
