// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The formats of scenes in one table, and ReadSceneByName, which reads a scene of any of them.
#pragma once

#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

struct SceneFileFormat {
  const char* name;                      // For users: "pbrt-v4".
  std::span<const char* const> endings;  // Ends of file names, in lower case: ".pbrt".
  // Errors: as ReadScene.
  absl::StatusOr<ReadSceneResult> (*read)(const std::string& main_file, FileSource& files,
                                          const SceneReaderLimits& limits);
};

// The first is pbrt-v4, which also reads files with the ending of no format.
std::span<const SceneFileFormat> SceneFileFormats();
// Whether the name ends as scenes of some format do, in upper or lower case.
bool HasSceneEnding(const std::string& name);
// ".pbrt, .gltf or .glb".
std::string SceneEndings();

// Reads with the format of the name's ending. Errors: as ReadScene.
absl::StatusOr<ReadSceneResult> ReadSceneByName(const std::string& main_file, FileSource& files,
                                                const SceneReaderLimits& limits = {});

}  // namespace sheaf
