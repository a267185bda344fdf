// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The form that morph targets and a skin give a primitive (glTF 2.0 specification, sec. 3.7.2.2 and
// 3.7.3).
#pragma once

#include <vector>

#include "common/math/transform.h"
#include "common/scene/gltf/meshes.h"
#include "common/scene/scene_description.h"

namespace sheaf::gltf {

// weights: of the morph targets; missing ones are 0. joints: for each joint of the skin the matrix
// from the mesh's space to the world; empty without a skin. Joints that do not exist move nothing.
VertexStep Deformed(const Primitive& primitive, const std::vector<double>& weights,
                    const std::vector<Matrix4>& joints);

}  // namespace sheaf::gltf
