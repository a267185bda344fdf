// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TangentPlane: the shading normal and tangents of a surface point, from which normal maps start.
#pragma once

#include "common/math/vec.h"

namespace sheaf::render {

// The tangent plane of a surface at a point, for normal and bump maps. Space: any; n and the result
// are in the same space.
struct TangentPlane {
  Vec3d n;                    // Unit: the shading normal.
  Vec3d dpdu, dpdv;           // By the texture coordinates uv. In a space with the world's axes.
  bool has_tangents = false;  // Otherwise there are no usable uvs.
};

}  // namespace sheaf::render
