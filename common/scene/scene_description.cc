// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/scene_description.h"

#include "absl/strings/str_cat.h"

namespace sheaf {

std::string FormatLocation(const SceneDescription& scene, SourceLocation location) {
  if (location.file < 0 || location.file >= static_cast<int32_t>(scene.files.size())) {
    return "(no location)";
  }
  const std::string& file = scene.files[static_cast<size_t>(location.file)];
  if (location.line == 0) return file;
  return absl::StrCat(file, ":", location.line, ":", location.column);
}

}  // namespace sheaf
