// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The grids and clouds of media, read and made ready.
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/volume/volume_array.h"
#include "common/volume/volume_file.h"
#include "worker/render/medium.h"

namespace sheaf::render {
namespace {

// The grid of densities that files have, and that of temperatures that they may have. Source:
// pbrt-v4's names.
constexpr char kDensityGrid[] = "density";
constexpr char kTemperatureGrid[] = "temperature";

absl::Status CannotGlow(const std::string& where) {
  return absl::InvalidArgumentError(
      absl::StrCat(where,
                   " shines and is not the same everywhere, which Sheaf does not render; "
                   "set \"float Lescale\" 0 to have it without its light"));
}

absl::StatusOr<VolumeGrid> ReadDensity(const std::string& where,
                                       const MediumDescription& description,
                                       const VolumeFileMedium& volume, FileSource& files,
                                       int thread_count) {
  const auto path = files.LocalPath(volume.file);
  if (!path.ok()) return path.status();
  const std::string file = absl::StrCat(where, ": ", volume.file);
  const auto entries = ListVolumeFile(file, *path);
  if (!entries.ok()) return entries.status();
  for (const VolumeFileEntry& entry : *entries) {
    if (entry.name == kTemperatureGrid && description.radiance_scale > 0) return CannotGlow(where);
  }
  return ReadVolumeGrid(file, *path, kDensityGrid, {}, thread_count);
}

}  // namespace

absl::StatusOr<std::unique_ptr<const VaryingMedium>> MediumTable::MakeVarying(
    const std::string& where, const MediumDescription& description, const Affine& placement,
    FileSource& files, int thread_count) {
  const Rgb sigma_t = (description.sigma_a.rgb + description.sigma_s.rgb) * description.scale;
  const VaryingMedium::Placement placed{placement, MaxComponent(sigma_t), thread_count};
  const auto own = [](absl::StatusOr<VaryingMedium> medium)
      -> absl::StatusOr<std::unique_ptr<const VaryingMedium>> {
    if (!medium.ok()) return medium.status();
    return std::make_unique<const VaryingMedium>(*std::move(medium));
  };
  if (const auto* cloud = std::get_if<CloudMedium>(&description.kind)) {
    if (description.emits && description.radiance_scale > 0) return CannotGlow(where);
    return own(VaryingMedium::FromCloud(
        where,
        CloudDensity({cloud->density, cloud->wispiness, cloud->frequency, cloud->p0, cloud->p1}),
        placed));
  }
  absl::StatusOr<VolumeGrid> grid = absl::InvalidArgumentError(
      absl::StrCat(where,
                   " is a grid of colours, which Sheaf does not render; use a uniformgrid of "
                   "densities"));
  if (const auto* volume = std::get_if<VolumeFileMedium>(&description.kind)) {
    grid = ReadDensity(where, description, *volume, files, thread_count);
  } else if (const auto* uniform = std::get_if<UniformGridMedium>(&description.kind)) {
    if (description.emits && description.radiance_scale > 0) return CannotGlow(where);
    grid = VolumeGridFromArray(where, kDensityGrid,
                               {uniform->box.counts, uniform->box.p0, uniform->box.p1},
                               uniform->density);
  }
  if (!grid.ok()) return grid.status();
  return own(VaryingMedium::FromGrid(where, *std::move(grid), placed));
}

}  // namespace sheaf::render
