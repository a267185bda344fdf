// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The extensions of glTF that Sheaf reads.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include "common/scene/pbrt/syntax/diagnostics.h"

namespace sheaf::gltf {

inline constexpr char kInstancing[] = "EXT_mesh_gpu_instancing";

// Notes the others that the file uses; they are errors where the file requires them.
void CheckExtensions(const tinygltf::Model& model, Diagnostics* diagnostics);

}  // namespace sheaf::gltf
