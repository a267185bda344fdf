// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/file_emission.h"

#include <algorithm>
#include <string>
#include <variant>

#include "absl/status/statusor.h"

namespace sheaf::render {

void ResolveFileEmission(FileSource& files, SceneDescription* scene, VolumeReader* volumes) {
  VolumeReader reader;
  if (volumes == nullptr) volumes = &reader;
  for (MediumDescription& medium : scene->media) {
    const auto* volume = std::get_if<VolumeFileMedium>(&medium.kind);
    if (volume == nullptr || volume->temperature_grid || !medium.emits) continue;
    const absl::StatusOr<std::string> path = files.LocalPath(volume->file);
    if (!path.ok()) continue;
    const auto entries = volumes->List(volume->file, *path);
    if (!entries.ok()) continue;
    medium.emits = std::ranges::any_of(
        *entries, [](const VolumeFileEntry& entry) { return entry.name == kTemperatureGrid; });
  }
}

}  // namespace sheaf::render
