// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/medium_velocities.h"

#include <algorithm>
#include <span>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/volume/volume_array.h"
#include "worker/render/medium/grid_files.h"

namespace sheaf::render {
namespace {

// Returns the name that the medium gives, or the grid that "auto" finds.
absl::StatusOr<std::string> NameOf(const std::string& where, const VolumeFileMedium& volume,
                                   GridFiles* files) {
  if (volume.velocity_grid != kAnyVelocityGrid) return volume.velocity_grid;
  const auto entries = files->List(where, volume.file);
  if (!entries.ok()) return entries.status();
  for (const char* name : kVelocityGridNames) {
    if (std::any_of(entries->begin(), entries->end(),
                    [name](const VolumeFileEntry& e) { return e.name == name; })) {
      return name;
    }
  }
  // If the grid is missing, the error lists the available ones.
  return kVelocityGridNames[0];
}

absl::StatusOr<VolumeGrid> ReadVelocities(const std::string& where, const MediumDescription& medium,
                                          GridFiles* files) {
  if (const auto* uniform = std::get_if<UniformGridMedium>(&medium.kind)) {
    const GridBox& box = uniform->box;
    return VolumeGridFromArray(where, "velocity", {box.counts, box.p0, box.p1},
                               std::span<const Vec3f>(uniform->velocity));
  }
  const auto& volume = std::get<VolumeFileMedium>(medium.kind);
  const auto name = NameOf(where, volume, files);
  if (!name.ok()) return name.status();
  auto grid = files->Read(where, volume.file, *name);
  if (grid.ok() && !grid->is_vector()) {
    return absl::InvalidArgumentError(absl::StrCat(where, ": ", volume.file, ": grid \"", *name,
                                                   "\" holds numbers, but velocities are vectors; ",
                                                   "name a grid of vectors"));
  }
  return grid;
}

}  // namespace

absl::StatusOr<MediumVelocities> ReadMediumVelocities(FileSource& files, int thread_count,
                                                      SceneDescription* scene) {
  MediumVelocities velocities(scene->media.size());
  if (!(scene->camera.shutter_close > scene->camera.shutter_open)) return velocities;
  GridFiles grid_files(&files, thread_count);
  for (size_t i = 0; i < velocities.size(); ++i) {
    MediumDescription& medium = scene->media[i];
    if (!medium.Moves()) continue;
    const std::string where =
        absl::StrCat(FormatLocation(*scene, medium.location), ": medium \"", medium.name, "\"");
    auto grid = ReadVelocities(where, medium, &grid_files);
    if (!grid.ok()) return grid.status();
    if (grid->info().values.max > 0) {
      velocities[i] = *std::move(grid);
      continue;
    }
    LogWarning(absl::StrCat(where, ": \"velocity\" has no effect: grid \"", grid->info().name,
                            "\" is 0 everywhere"));
    medium.RemoveMotion();
  }
  return velocities;
}

}  // namespace sheaf::render
