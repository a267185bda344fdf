// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DisplaceMeshes: applies displacement textures to the meshes of a scene.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

struct DisplacementLimits {
  uint64_t triangles_max = 0;  // Total over all displaced meshes.
  uint64_t texture_cache_bytes_max = 0;
};

// Replaces the mesh of every shape that has a displacement by a displaced mesh of its own; shapes
// share one if mesh, texture, edge length and the transform's linear part are equal (and its
// translation, where the texture depends on the position). Meshes that are no longer used are
// emptied. Texture positions and edge lengths are those at shutter open; for shapes in an object
// definition, those of the definition.
// Errors: those of TextureProgram::Build and DisplaceMesh, with the shape's location.
absl::Status DisplaceMeshes(FileSource& files, const DisplacementLimits& limits,
                            SceneDescription* scene);

}  // namespace sheaf::render
