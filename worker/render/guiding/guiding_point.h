// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidingPoint: a vertex of a path, as guiding tells vertices apart.
#pragma once

#include "common/math/vec.h"

namespace sheaf::render {

struct GuidingPoint {
  Vec3f p;  // Render space.
  // The normal, on the path's side, of a surface that no light passes; unit. Zero for other
  // surfaces and in media.
  Vec3f n{};
};

}  // namespace sheaf::render
