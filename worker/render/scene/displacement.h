// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The meshes of a scene that textures displace.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

struct DisplacementLimits {
  uint64_t triangles_max = 0;  // Of all displaced meshes together.
  uint64_t texture_cache_bytes_max = 0;
};

// Has every shape with a displacement refer to a mesh of its own that is displaced already; shapes
// share one where mesh, texture, edge length and the transform's linear part are equal (and its
// translation, where the texture depends on the place). Meshes that are no longer used are emptied.
// Positions in textures and edge lengths are those when the shutter opens; of shapes in an object
// definition, those of the definition.
// Errors: those of TextureProgram::Build and DisplaceMesh, with the shape's location.
absl::Status DisplaceMeshes(FileSource& files, const DisplacementLimits& limits,
                            SceneDescription* scene);

}  // namespace sheaf::render
