// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Shapes with curved surfaces as triangle meshes.
#pragma once

#include "common/scene/scene_description.h"

namespace sheaf::render {

// Steps along each parameter of a surface.
inline constexpr uint32_t kPlainShapeSteps = 32;

// Replaces every sphere, disk, cylinder and bilinear patch by triangles with the normals of the
// surface.
void MakePlain(SceneDescription* scene);

}  // namespace sheaf::render
