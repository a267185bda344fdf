// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DisplaceMesh: refines a mesh and displaces it along its normals. Triangles are bisected at their
// longest edge until no edge is too long (Rosenberg and Stenger 1975, "A lower bound on the angles
// of triangles constructed by bisecting the longest side": no angle drops below half the smallest).
// Whether and where an edge is cut depends on its two ends alone, so neighbors agree and there are
// no cracks.
//
// Corners at equal positions are one site of the surface, however many vertices the file has for
// it: a site moves by the mean of its vertices' displacements, along the mean of their unit
// normals. The surface thus stays closed across uv seams and normal creases.
#pragma once

#include <cstdint>
#include <functional>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

// Displacement in object space of a point of the undisplaced mesh.
using HeightFunction = std::function<float(Vec2f uv, Vec3d p_object)>;

// edge_length: in the target space of target_from_object. The result has vertex normals of the
// displaced surface (the weights of Max 1999, exact for spheres), and uvs: those of the mesh, or
// the default corners for meshes without uvs. A mesh with zero displacement everywhere is returned
// unchanged. Requires: edge_length > 0; the mesh does not deform. Errors: kResourceExhausted above
// triangles_max; kInvalidArgument where a height is not finite.
absl::StatusOr<TriangleMesh> DisplaceMesh(const TriangleMesh& mesh,
                                          const Affine& target_from_object, double edge_length,
                                          uint64_t triangles_max, const HeightFunction& height);

}  // namespace sheaf::render
