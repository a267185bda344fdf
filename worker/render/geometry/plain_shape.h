// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Shapes with curved surfaces as triangle meshes.
#pragma once

#include <cstdint>
#include <optional>

#include "common/scene/scene_description.h"

namespace sheaf::render {

// Steps along each parameter of a surface.
inline constexpr uint32_t kPlainShapeSteps = 32;

// A sphere, disk or cylinder as triangles with the normals and uvs of the surface, `steps` along
// each parameter; nothing for other shapes.
std::optional<TriangleMesh> TrianglesOf(const ShapeDescription& shape, uint32_t steps);

// Replaces every sphere, disk, cylinder and bilinear patch by triangles with the normals of the
// surface.
void MakePlain(SceneDescription* scene);

}  // namespace sheaf::render
