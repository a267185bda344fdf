// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Buffer views that are compressed by EXT_meshopt_compression, or by KHR_meshopt_compression, which
// is the same but for a later version of the codec of vertices. Their bytes are untrusted.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include "common/scene/gltf/accessors.h"
#include "common/scene/pbrt/syntax/diagnostics.h"

namespace sheaf::gltf {

inline constexpr char kMeshopt[] = "EXT_meshopt_compression";
inline constexpr char kMeshoptKhr[] = "KHR_meshopt_compression";
inline constexpr uint64_t kMeshoptStrideMax = 256;
// The codec of vertices stores at least a byte for 256 of them; those of indices store more. A view
// that claims to be more is damaged, which is seen before memory is taken.
inline constexpr uint64_t kMeshoptExpansionMax = 256;

// Gives compressed views buffers of their own, with what they mean. False after an error, which is
// reported. accessors: what the memory is charged to.
bool DecodeMeshoptViews(tinygltf::Model* model, Accessors* accessors, Diagnostics* diagnostics);

}  // namespace sheaf::gltf
