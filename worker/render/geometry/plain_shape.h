// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts shapes with curved surfaces to triangle meshes.
#pragma once

#include <cstdint>
#include <optional>

#include "common/scene/scene_description.h"

namespace sheaf::render {

// Number of steps along each parameter of a surface.
inline constexpr uint32_t kPlainShapeSteps = 32;

// Converts a sphere, disk or cylinder to triangles with the normals and uvs of the surface, `steps`
// along each parameter; none for other shapes.
std::optional<TriangleMesh> TrianglesOf(const ShapeDescription& shape, uint32_t steps);

// Replaces every sphere, disk, cylinder and bilinear patch by triangles with the surface's normals.
void MakePlain(SceneDescription* scene);

}  // namespace sheaf::render
