// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reading and preparing the grids and clouds of media.
#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/volume/volume_array.h"
#include "worker/render/medium/grid_files.h"
#include "worker/render/medium/medium.h"

namespace sheaf::render {
namespace {

constexpr char kDensityGrid[] = "density";

// Returns the temperatures of the medium's file; none if the scene does not name them, and the file
// has none.
absl::StatusOr<std::optional<VolumeGrid>> ReadTemperatures(const std::string& where,
                                                           const VolumeFileMedium& volume,
                                                           GridFiles& files) {
  const std::string name = volume.temperature_grid.value_or(kTemperatureGrid);
  const auto entries = files.List(where, volume.file);
  if (!entries.ok()) return entries.status();
  const bool is_there = std::any_of(entries->begin(), entries->end(),
                                    [&](const VolumeFileEntry& e) { return e.name == name; });
  // If a grid that the scene names is missing, the error lists the available ones.
  if (!is_there && !volume.temperature_grid) return std::optional<VolumeGrid>();
  auto grid = files.Read(where, volume.file, name);
  if (!grid.ok()) return grid.status();
  return std::optional<VolumeGrid>(*std::move(grid));
}

absl::StatusOr<VolumeGrid> GridOf(const std::string& where, const std::string& name,
                                  const GridBox& box, const std::vector<float>& values) {
  return VolumeGridFromArray(where, name, {box.counts, box.p0, box.p1}, values);
}

// Returns the densities of a uniform grid or a file.
absl::StatusOr<VolumeGrid> DensityGrid(const std::string& where,
                                       const MediumDescription& description, GridFiles& files) {
  if (const auto* uniform = std::get_if<UniformGridMedium>(&description.kind)) {
    return GridOf(where, kDensityGrid, uniform->box, uniform->density);
  }
  const auto& volume = std::get<VolumeFileMedium>(description.kind);
  return files.Read(where, volume.file, volume.density_grid);
}

// A density of 1 in the whole box, up to its faces.
absl::StatusOr<HeterogeneousMedium> EvenDensity(const std::string& where, const GridBox& box,
                                                const HeterogeneousMedium::Placement& placement) {
  const Vec3d size = box.p1 - box.p0;
  auto grid = GridOf(where, kDensityGrid, {{3, 3, 3}, box.p0 - size, box.p1 + size},
                     std::vector<float>(27, 1.0f));
  if (!grid.ok()) return grid.status();
  grid->set_box({{0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}});
  return HeterogeneousMedium::FromGrid(where, *std::move(grid), placement);
}

absl::StatusOr<HeterogeneousMedium> MovingGrid(const std::string& where, VolumeGrid density,
                                               VolumeGrid velocities, double duration,
                                               const HeterogeneousMedium::Placement& placement) {
  auto motion = VolumeMotion::Make(where, std::move(velocities), duration, density);
  if (!motion.ok()) return motion.status();
  return HeterogeneousMedium::FromMovingGrid(where, std::move(density), *std::move(motion),
                                             placement);
}

}  // namespace

absl::StatusOr<std::vector<MediumTable::Part>> MediumTable::MakeParts(
    const std::string& where, const MediumDescription& description, const Affine& placement,
    Movement movement, GridFiles& files, const Options& options) {
  const Rgb sigma_t = (description.sigma_a.rgb + description.sigma_s.rgb) * description.scale;
  HeterogeneousMedium::Placement placed{placement, MaxComponent(sigma_t), options.thread_count,
                                        options.bound_once};
  std::vector<Part> parts;
  const auto add = [&](absl::StatusOr<HeterogeneousMedium> density, Part::Kind kind,
                       ColorPart color) {
    if (density.ok()) parts.push_back({*std::move(density), kind, color});
    return density.status();
  };
  absl::Status status;
  if (const auto* cloud = std::get_if<CloudMedium>(&description.kind)) {
    const CloudDensity density(
        {cloud->density, cloud->wispiness, cloud->frequency, cloud->p0, cloud->p1});
    status = add(HeterogeneousMedium::FromCloud(where, density, placed), Part::Kind::kBoth,
                 ColorPart::kGray);
  } else if (const auto* colors = std::get_if<RgbGridMedium>(&description.kind)) {
    placed.extinction_max = description.scale;
    const auto add_colors = [&](const std::vector<Rgb>& cells, Part::Kind kind) -> absl::Status {
      // Without cells pbrt-v4 uses 1 everywhere in the box.
      if (cells.empty())
        return add(EvenDensity(where, colors->box, placed), kind, ColorPart::kGray);
      const auto split = SplitColors(cells);
      for (size_t i = 0; i < split.size(); ++i) {
        if (split[i].empty()) continue;
        auto grid = GridOf(where, kDensityGrid, colors->box, split[i]);
        if (!grid.ok()) return grid.status();
        const absl::Status added =
            add(HeterogeneousMedium::FromGrid(where, *std::move(grid), placed), kind,
                static_cast<ColorPart>(i));
        if (!added.ok()) return added;
      }
      return absl::OkStatus();
    };
    status = add_colors(colors->sigma_a, Part::Kind::kAbsorbs);
    if (status.ok()) status = add_colors(colors->sigma_s, Part::Kind::kScatters);
    // A medium without effect is still heterogeneous.
    if (status.ok() && parts.empty()) {
      auto nothing =
          GridOf(where, kDensityGrid, colors->box, std::vector<float>(colors->box.size()));
      if (!nothing.ok()) return nothing.status();
      status = add(HeterogeneousMedium::FromGrid(where, *std::move(nothing), placed),
                   Part::Kind::kAbsorbs, ColorPart::kGray);
    }
  } else {
    absl::StatusOr<VolumeGrid> grid = DensityGrid(where, description, files);
    if (!grid.ok()) return grid.status();
    auto medium = movement.velocities
                      ? MovingGrid(where, *std::move(grid), *std::move(movement.velocities),
                                   movement.duration, placed)
                      : HeterogeneousMedium::FromGrid(where, *std::move(grid), placed);
    status = add(std::move(medium), Part::Kind::kBoth, ColorPart::kGray);
  }
  if (!status.ok()) return status;
  return parts;
}

absl::StatusOr<std::unique_ptr<const MediumEmission>> MediumTable::MakeEmission(
    const std::string& where, const MediumDescription& description, const Affine& placement,
    GridFiles& files, const Options& options) {
  if (!description.emits || !(description.radiance_scale > 0)) return nullptr;
  auto medium_emission = std::make_unique<MediumEmission>(
      placement, description.radiance, description.radiance_scale, options.spectral);
  if (const auto* volume = std::get_if<VolumeFileMedium>(&description.kind)) {
    auto grid = ReadTemperatures(where, *volume, files);
    if (!grid.ok()) return grid.status();
    if (!*grid) return nullptr;
    if ((*grid)->is_vector()) {
      return absl::InvalidArgumentError(absl::StrCat(
          where, ": ", volume->file, ": grid \"", (*grid)->info().name,
          "\" holds vectors, but temperatures are numbers; write it as a grid of floats"));
    }
    medium_emission->SetTemperatures(**std::move(grid), volume->emission);
  } else if (const auto* uniform = std::get_if<UniformGridMedium>(&description.kind)) {
    if (!uniform->temperature_k.empty()) {
      auto grid = GridOf(where, kTemperatureGrid, uniform->box, uniform->temperature_k);
      if (!grid.ok()) return grid.status();
      medium_emission->SetTemperatures(*std::move(grid), uniform->emission);
    }
    if (!uniform->radiance_scale.empty()) {
      auto grid = GridOf(where, "Lescale", uniform->box, uniform->radiance_scale);
      if (!grid.ok()) return grid.status();
      medium_emission->SetFactors(*std::move(grid));
    }
  } else if (const auto* colors = std::get_if<RgbGridMedium>(&description.kind)) {
    std::vector<Vec3f> cells;
    for (const Rgb& cell : colors->radiance) cells.push_back({cell.r, cell.g, cell.b});
    auto grid =
        VolumeGridFromArray(where, "Le", {colors->box.counts, colors->box.p0, colors->box.p1},
                            std::span<const Vec3f>(cells));
    if (!grid.ok()) return grid.status();
    medium_emission->SetColors(*std::move(grid));
  }
  return medium_emission;
}

}  // namespace sheaf::render
