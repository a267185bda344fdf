// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Textures as one value each.
#pragma once

#include "absl/status/status.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// Replaces every texture that a material or a cut-out reads by its mean over uv in [0, 2]^2, or
// in [0, 1]^2 where an image of the scene does not repeat (and for mappings from space over the
// cube there that is as wide), as RGB. Errors: of TextureProgram::Build.
absl::Status ReplaceTexturesByMeans(FileSource& files, SceneDescription* scene);

}  // namespace sheaf::render
