// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/scene_description.h"

#include "absl/strings/str_cat.h"

namespace sheaf {

std::string FormatLocation(const SceneDescription& scene, SourceLocation location) {
  if (location.file < 0 || location.file >= static_cast<int32_t>(scene.files.size())) {
    return "(no location)";
  }
  return absl::StrCat(scene.files[static_cast<size_t>(location.file)], ":", location.line, ":",
                      location.column);
}

}  // namespace sheaf
