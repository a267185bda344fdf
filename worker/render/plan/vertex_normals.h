// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// IsTilted: whether vertex normals depart from the faces of a mesh, so that scattering about them
// would lose light (bsdf/perturbed_normal.h).
#pragma once

#include "common/scene/scene_description.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

// Whether the transform keeps angles, to within rounding.
bool KeepsAngles(const Affine& transform);

// Whether a vertex normal makes an angle with a face at its vertex whose cosine is below
// cosine_max, in the space where the mesh is placed. Also at the other steps of a deforming mesh.
// Normals that face away from their faces turn these around.
bool IsTilted(const TriangleMesh& mesh, const Affine& target_from_mesh, double cosine_max);
bool IsTilted(const BilinearMesh& mesh, const Affine& target_from_mesh, double cosine_max);

}  // namespace sheaf::render
