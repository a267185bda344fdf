// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads scene files into a SceneDescription: the first arrow of the data flow.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"
#include "common/scene/scene_reader_limits.h"

namespace sheaf {

struct ReadSceneResult {
  SceneDescription scene;
  std::vector<SceneDiagnostic> diagnostics;  // Notes and warnings; errors make the call fail.
  // How far apart the two eyes are that were asked for by cameras, in the units of the camera's
  // space; the camera is halfway. 0: one camera.
  float eye_distance = 0;
};

// Reads main_file (canonical name, normally just its file name) in the pbrt-v4 format, with all
// files it includes and all meshes. Image and texture files are resolved (so that FilesUsed is
// complete) but not decoded.
// Errors: kInvalidArgument with every error found, one per line; kResourceExhausted, likewise, if
// lack of memory is among them; kNotFound for the main file.
absl::StatusOr<ReadSceneResult> ReadScene(const std::string& main_file, FileSource& files,
                                          const SceneReaderLimits& limits = {});

}  // namespace sheaf
