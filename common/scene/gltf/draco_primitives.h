// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Primitives that are compressed by KHR_draco_mesh_compression.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include "common/scene/gltf/accessors.h"
#include "common/scene/pbrt/syntax/diagnostics.h"

namespace sheaf::gltf {

inline constexpr char kDraco[] = "KHR_draco_mesh_compression";

// Gives compressed primitives accessors of their own, with what is in their Draco meshes.
// Primitives that name the same mesh share them. False after an error, which is reported.
// accessors: what the memory is charged to.
bool DecodeDracoPrimitives(tinygltf::Model* model, Accessors* accessors, Diagnostics* diagnostics);

}  // namespace sheaf::gltf
