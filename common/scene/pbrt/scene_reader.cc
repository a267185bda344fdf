// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/scene_reader.h"

#include <utility>

#include "common/scene/pbrt/pbrt_parser.h"
#include "common/scene/pbrt/scene_builder.h"
#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/syntax/diagnostics.h"

namespace sheaf {

absl::StatusOr<ReadSceneResult> ReadScene(const std::string& main_file, FileSource& files,
                                          const SceneReaderLimits& limits) {
  ReadSceneResult result;
  Diagnostics diagnostics(&result.scene, limits);
  SceneFiles scene_files(&files, limits.repeated_bytes_max);
  SceneBuilder builder(&result.scene, &scene_files, &diagnostics, limits);
  PbrtParser parser(&builder, &scene_files, &diagnostics, limits);
  if (absl::Status status = parser.ParseMainFile(main_file); !status.ok()) return status;
  if (absl::Status status = diagnostics.ToStatus(); !status.ok()) return status;
  result.diagnostics = diagnostics.TakeAll();
  return result;
}

}  // namespace sheaf
