// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The grids and clouds of media, read and made ready.
#include <algorithm>
#include <optional>
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

// The grid of the name in the medium's file; none where there is none.
absl::StatusOr<std::optional<VolumeGrid>> ReadGrid(const std::string& where,
                                                   const VolumeFileMedium& volume,
                                                   const std::string& name, FileSource& files,
                                                   int thread_count) {
  const auto path = files.LocalPath(volume.file);
  if (!path.ok()) return path.status();
  const std::string file = absl::StrCat(where, ": ", volume.file);
  const auto entries = ListVolumeFile(file, *path);
  if (!entries.ok()) return entries.status();
  const bool is_there = std::any_of(entries->begin(), entries->end(),
                                    [&](const VolumeFileEntry& e) { return e.name == name; });
  if (!is_there) return std::optional<VolumeGrid>();
  auto grid = ReadVolumeGrid(file, *path, name, {}, thread_count);
  if (!grid.ok()) return grid.status();
  return std::optional<VolumeGrid>(*std::move(grid));
}

absl::StatusOr<VolumeGrid> GridOf(const std::string& where, const std::string& name,
                                  const GridBox& box, const std::vector<float>& values) {
  return VolumeGridFromArray(where, name, {box.counts, box.p0, box.p1}, values);
}

}  // namespace

absl::StatusOr<std::unique_ptr<const VaryingMedium>> MediumTable::MakeVarying(
    const std::string& where, const MediumDescription& description, const Affine& placement,
    FileSource& files, const Options& options) {
  const Rgb sigma_t = (description.sigma_a.rgb + description.sigma_s.rgb) * description.scale;
  const VaryingMedium::Placement placed{placement, MaxComponent(sigma_t), options.thread_count,
                                        options.bound_once};
  const auto own = [](absl::StatusOr<VaryingMedium> medium)
      -> absl::StatusOr<std::unique_ptr<const VaryingMedium>> {
    if (!medium.ok()) return medium.status();
    return std::make_unique<const VaryingMedium>(*std::move(medium));
  };
  if (const auto* cloud = std::get_if<CloudMedium>(&description.kind)) {
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
    const auto path = files.LocalPath(volume->file);
    if (!path.ok()) return path.status();
    // The error of a file without it names the grids that are there.
    grid = ReadVolumeGrid(absl::StrCat(where, ": ", volume->file), *path, kDensityGrid, {},
                          options.thread_count);
  } else if (const auto* uniform = std::get_if<UniformGridMedium>(&description.kind)) {
    grid = GridOf(where, kDensityGrid, uniform->box, uniform->density);
  }
  if (!grid.ok()) return grid.status();
  return own(VaryingMedium::FromGrid(where, *std::move(grid), placed));
}

absl::StatusOr<std::unique_ptr<const MediumGlow>> MediumTable::MakeGlow(
    const std::string& where, const MediumDescription& description, const Affine& placement,
    FileSource& files, const Options& options) {
  if (!description.emits || !(description.radiance_scale > 0)) return nullptr;
  auto glow = std::make_unique<MediumGlow>(placement, description.radiance,
                                           description.radiance_scale, options.spectral);
  if (const auto* volume = std::get_if<VolumeFileMedium>(&description.kind)) {
    auto grid = ReadGrid(where, *volume, kTemperatureGrid, files, options.thread_count);
    if (!grid.ok()) return grid.status();
    if (!*grid) return nullptr;
    if ((*grid)->is_vector()) {
      return absl::InvalidArgumentError(absl::StrCat(
          where, ": ", volume->file, ": grid \"", kTemperatureGrid,
          "\" holds vectors, but temperatures are numbers; write it as a grid of floats"));
    }
    glow->SetTemperatures(**std::move(grid), volume->emission);
  } else if (const auto* uniform = std::get_if<UniformGridMedium>(&description.kind)) {
    if (!uniform->temperature_k.empty()) {
      auto grid = GridOf(where, kTemperatureGrid, uniform->box, uniform->temperature_k);
      if (!grid.ok()) return grid.status();
      glow->SetTemperatures(*std::move(grid), uniform->emission);
    }
    if (!uniform->radiance_scale.empty()) {
      auto grid = GridOf(where, "Lescale", uniform->box, uniform->radiance_scale);
      if (!grid.ok()) return grid.status();
      glow->SetFactors(*std::move(grid));
    }
  }
  return glow;
}

}  // namespace sheaf::render
