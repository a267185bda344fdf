// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TangentPlane: the shading normal and tangents of a surface point, from which normal maps start.
#pragma once

#include "common/math/vec.h"

namespace sheaf::render {

// How a surface lies at a point, for maps that turn its normal. Space: any; n and what comes of it
// are in it too.
struct TangentPlane {
  Vec3d n;           // Unit: the shading normal.
  Vec3d dpdu, dpdv;  // By the uv that textures are read at. In a space of the world's axes.
  bool has_tangents = false;  // Else there is no uv to speak of.
};

}  // namespace sheaf::render
