// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A mesh refined and moved along its normals. Triangles are halved across their longest edge until
// no edge is too long (Rosenberg and Stenger 1975, "A lower bound on the angles of triangles
// constructed by bisecting the longest side": no angle becomes less than half the least). Whether
// and where an edge is cut depends on its two ends alone, so neighbours agree and nothing cracks.
//
// Corners of equal positions are one place of the surface, however many vertices the file has for
// it: a place moves by the mean of its vertices' displacements, along the mean of their unit
// normals. Across a seam of uv, or a crease of normals, the surface thus stays closed.
#pragma once

#include <cstdint>
#include <functional>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

// Displacement in object space, of a point of the mesh before it is moved.
using HeightFunction = std::function<float(Vec2f uv, Vec3d p_object)>;

// edge_length: in the space that target_from_object leads to. The result has a normal at each
// vertex, of the displaced surface (the weights of Max 1999, exact for spheres), and uvs: those of
// the mesh, or the corners that meshes without uvs have. Meshes that are displaced nowhere come
// back as they are. Requires: edge_length > 0; the mesh does not deform.
// Errors: kResourceExhausted above triangles_max; kInvalidArgument where a height is not finite.
absl::StatusOr<TriangleMesh> DisplaceMesh(const TriangleMesh& mesh,
                                          const Affine& target_from_object, double edge_length,
                                          uint64_t triangles_max, const HeightFunction& height);

}  // namespace sheaf::render
