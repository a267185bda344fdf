// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads a glTF 2.0 file into a SceneDescription. docs/gltf.md lists what is supported.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/gltf/gltf_view.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

inline constexpr size_t kGltfInstancesMax = 10'000'000;

// Reads main_file (canonical name, .gltf or .glb) with its buffers. Images are resolved, and those
// within it become derived files, but they are not decoded.
// Errors: as ReadScene.
absl::StatusOr<ReadSceneResult> ReadGltf(const std::string& main_file, FileSource& files,
                                         const GltfView& view,
                                         const SceneReaderLimits& limits = {});

}  // namespace sheaf
