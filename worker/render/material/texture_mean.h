// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReplaceTexturesByMeans: reduces each texture to its mean value.
#pragma once

#include "absl/status/status.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// Replaces every texture of a material or a cut-out by its mean, as RGB, over uv in [0, 2]^2, or in
// [0, 1]^2 where an image of the scene does not repeat (for mappings from space, over the cube of
// the same width). Errors: those of TextureProgram::Build.
absl::Status ReplaceTexturesByMeans(FileSource& files, SceneDescription* scene);

}  // namespace sheaf::render
