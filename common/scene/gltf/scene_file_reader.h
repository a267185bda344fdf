// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads a scene of any format that Sheaf reads, by its name.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

// A glTF file for .gltf and .glb, with the view of the file GltfViewFile if there is one; else
// pbrt-v4. Errors: as ReadScene.
absl::StatusOr<ReadSceneResult> ReadSceneByName(const std::string& main_file, FileSource& files,
                                                const SceneReaderLimits& limits = {});

}  // namespace sheaf
