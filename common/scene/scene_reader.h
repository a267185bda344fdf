// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// scene files > SceneDescription: the first arrow of the data flow.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"

namespace sheaf {

struct SceneDiagnostic {
  enum class Severity { kNote, kWarning, kError } severity = Severity::kError;
  std::string text;  // "file:line:column: what, why, what to do".
};

struct SceneReaderLimits {
  uint64_t triangles_max = uint64_t{1} << 31;
  uint64_t memory_bytes_max = uint64_t{16} << 30;  // Of the description.
  std::string memory_limit = "memory_bytes_max";   // What sets that, for people.
  uint32_t include_depth_max = 64;
  uint64_t file_bytes_max = uint64_t{8} << 30;
  uint32_t errors_max = 50;  // Reading stops after this many.
  uint32_t notes_max = 200;  // Further notes and warnings are left out.
};

struct ReadSceneResult {
  SceneDescription scene;
  std::vector<SceneDiagnostic> diagnostics;  // Notes and warnings; errors make the call fail.
};

// Reads main_file (canonical name, normally just its file name) in the pbrt-v4 format, with all
// files it includes and all meshes. Image and texture files are resolved (so that FilesUsed is
// complete) but not decoded. Errors: kInvalidArgument with every error that was found, one a line;
// kResourceExhausted, likewise, where lack of memory is among them; kNotFound for the main file.
absl::StatusOr<ReadSceneResult> ReadScene(const std::string& main_file, FileSource& files,
                                          const SceneReaderLimits& limits = {});

}  // namespace sheaf
