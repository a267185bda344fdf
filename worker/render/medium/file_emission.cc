// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/file_emission.h"

#include <algorithm>
#include <variant>

#include "worker/render/medium/grid_files.h"

namespace sheaf::render {

void ResolveFileEmission(FileSource& files, SceneDescription* scene) {
  GridFiles grid_files(&files, 1);
  for (MediumDescription& medium : scene->media) {
    const auto* volume = std::get_if<VolumeFileMedium>(&medium.kind);
    if (volume == nullptr || volume->temperature_grid || !medium.emits) continue;
    const auto entries = grid_files.List(medium.name, volume->file);
    if (!entries.ok()) continue;
    medium.emits = std::ranges::any_of(
        *entries, [](const VolumeFileEntry& entry) { return entry.name == kTemperatureGrid; });
  }
}

}  // namespace sheaf::render
