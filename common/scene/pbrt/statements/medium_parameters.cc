// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// One function for each type of medium.
#include "common/scene/pbrt/statements/medium_parameters.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/supported_names.h"
#include "common/scene/spectrum/primaries.h"

namespace sheaf {
namespace {

void GetCoefficients(ParameterList& parameters, SceneFiles& files, MediumDescription* medium) {
  const ColorSpec one = RgbColor(Rgb::Gray(1));
  medium->sigma_a = GetColor(parameters, "sigma_a", ColorRole::kUnbounded, one, files);
  medium->sigma_s = GetColor(parameters, "sigma_s", ColorRole::kUnbounded, one, files);
  RequireCoefficient(parameters, "sigma_a", &medium->sigma_a);
  RequireCoefficient(parameters, "sigma_s", &medium->sigma_s);
}

void GetRadianceScale(ParameterList& parameters, MediumDescription* medium) {
  // pbrt-v4's files have both spellings.
  const char* name = parameters.Has("LeScale") ? "LeScale" : "Lescale";
  medium->radiance_scale = parameters.GetFloat(name, 1);
  if (!(medium->radiance_scale >= 0 && std::isfinite(medium->radiance_scale))) {
    parameters.ErrorAt(*parameters.Find(name), "must be finite and 0 or more");
    medium->radiance_scale = 1;
  }
}

void GetRadiance(ParameterList& parameters, SceneFiles& files, MediumDescription* medium) {
  medium->radiance = GetColor(parameters, "Le", ColorRole::kIlluminant, {}, files);
  medium->emits = parameters.Has("Le") && !medium->radiance.rgb.IsBlack();
}

TemperatureEmission GetTemperatureEmission(ParameterList& parameters) {
  TemperatureEmission emission;
  const char* name =
      parameters.Has("temperaturecutoff") ? "temperaturecutoff" : "temperatureoffset";
  emission.offset_k = parameters.GetFloat(name, 0);
  emission.scale = parameters.GetFloat("temperaturescale", 1);
  return emission;
}

void SetHomogeneous(ParameterList& parameters, SceneFiles& files, MediumDescription* medium) {
  const std::string preset = parameters.GetString("preset", "");
  if (preset.empty()) {
    GetCoefficients(parameters, files, medium);
  } else if (const MeasuredMedium* measured = FindMeasuredMedium(preset)) {
    medium->sigma_a = RgbColor(measured->sigma_a);
    medium->sigma_s = RgbColor(measured->sigma_s);
    for (const char* name : {"sigma_a", "sigma_s"}) {
      parameters.NoteWithoutEffect(name, "the preset defines it");
    }
  } else {
    parameters.ErrorAt(*parameters.Find("preset"),
                       absl::StrCat("\"", preset, "\" names no measured medium",
                                    NearestNameHint(preset, MeasuredMediumNames())));
  }
  GetRadiance(parameters, files, medium);
  GetRadianceScale(parameters, medium);
}

void GetCorners(ParameterList& parameters, Vec3d* p0, Vec3d* p1) {
  const Vec3d a = parameters.GetPoint3("p0", {0, 0, 0}), b = parameters.GetPoint3("p1", {1, 1, 1});
  *p0 = {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
  *p1 = {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
  if (p0->x < p1->x && p0->y < p1->y && p0->z < p1->z) return;
  parameters.Error(absl::StrCat(parameters.owner(), ": the box from \"p0\" to \"p1\" is empty"));
}

bool GetBox(ParameterList& parameters, GridBox* box) {
  const char* const names[3] = {"nx", "ny", "nz"};
  int64_t cells = 1;
  for (size_t i = 0; i < 3; ++i) {
    box->counts[i] = parameters.GetInteger(names[i], 1);
    if (box->counts[i] < 1 || box->counts[i] > kGridSideMax) {
      parameters.ErrorAt(*parameters.Find(names[i]),
                         absl::StrCat("must lie between 1 and ", kGridSideMax));
      return false;
    }
    cells *= box->counts[i];
  }
  if (cells > kGridCellsMax) {
    parameters.Error(absl::StrCat(parameters.owner(), ": a grid of ", cells,
                                  " cells is larger than the limit of ", kGridCellsMax));
    return false;
  }
  GetCorners(parameters, &box->p0, &box->p1);
  return true;
}

// One value per cell, or none if the parameter is absent.
std::vector<float> GetCells(ParameterList& parameters, const std::string& name,
                            const GridBox& box) {
  std::vector<float> values = parameters.GetFloats(name);
  if (values.empty()) return values;
  const Parameter& parameter = *parameters.Find(name);
  if (values.size() != box.size()) {
    parameters.ErrorAt(parameter, absl::StrCat("needs nx * ny * nz = ", box.size(),
                                               " values but has ", values.size()));
    return {};
  }
  for (size_t i = 0; i < values.size(); ++i) {
    if (values[i] >= 0 && std::isfinite(values[i])) continue;
    parameters.ErrorAt(parameter, absl::StrCat("value ", i + 1, " is ", values[i],
                                               " but must be finite and 0 or more"));
    return {};
  }
  return values;
}

// One velocity per cell, or none.
std::vector<Vec3f> GetVelocityCells(ParameterList& parameters, const GridBox& box) {
  std::vector<Vec3f> values = parameters.GetTriples("velocity", ParameterType::kVector3);
  if (values.empty() || values.size() == box.size()) return values;
  parameters.ErrorAt(
      *parameters.Find("velocity"),
      absl::StrCat("needs nx * ny * nz = ", box.size(), " vectors but has ", values.size()));
  return {};
}

void GetVelocityScale(ParameterList& parameters, MediumDescription* medium) {
  medium->velocity_scale = parameters.GetFloat("velocityscale", 1);
  if (!parameters.Has("velocity")) {
    parameters.NoteWithoutEffect("velocityscale", "there is no \"velocity\"");
  } else if (medium->velocity_scale == 0) {
    parameters.NoteWithoutEffect("velocity", "its \"velocityscale\" is 0");
  }
}

std::vector<Rgb> GetColorCells(ParameterList& parameters, const std::string& name,
                               const GridBox& box, ColorRole role) {
  const Parameter* parameter = parameters.FindTyped(name, ParameterType::kRgb);
  if (parameter == nullptr) return {};
  if (parameter->floats.size() != 3 * box.size()) {
    parameters.ErrorAt(*parameter, absl::StrCat("needs nx * ny * nz = ", box.size(),
                                                " colors but has ", parameter->floats.size() / 3));
    return {};
  }
  std::vector<Rgb> cells(box.size());
  for (size_t i = 0; i < cells.size(); ++i) {
    const float* c = &parameter->floats[3 * i];
    const Rgb written{c[0], c[1], c[2]};
    if (!IsFinite(written) || std::min({c[0], c[1], c[2]}) < 0) {
      parameters.ErrorAt(*parameter, absl::StrCat("color ", i + 1, " is not finite and 0 or more"));
      return {};
    }
    const Rgb srgb = SrgbFromPrimaries(written, parameter->primaries, role);
    cells[i] = {std::max(srgb.r, 0.f), std::max(srgb.g, 0.f), std::max(srgb.b, 0.f)};
  }
  return cells;
}

void SetUniformGrid(ParameterList& parameters, SceneFiles& files, MediumDescription* medium) {
  UniformGridMedium grid;
  GetCoefficients(parameters, files, medium);
  if (GetBox(parameters, &grid.box)) {
    grid.density = GetCells(parameters, "density", grid.box);
    grid.temperature_k = GetCells(parameters, "temperature", grid.box);
    grid.velocity = GetVelocityCells(parameters, grid.box);
    if (!parameters.Has("density")) {
      parameters.Error(absl::StrCat(parameters.owner(), " needs \"float density\", one per cell"));
    }
    const Parameter* scale = parameters.Find("Lescale");
    if (scale != nullptr && scale->floats.size() == 1) {
      GetRadianceScale(parameters, medium);
    } else {
      grid.radiance_scale = GetCells(parameters, "Lescale", grid.box);
    }
  }
  GetRadiance(parameters, files, medium);
  grid.emission = GetTemperatureEmission(parameters);
  if (parameters.Has("Le") && parameters.Has("temperature")) {
    parameters.ErrorAt(
        *parameters.Find("temperature"),
        "excludes \"Le\": both define the emission of the medium; give one or the other");
  }
  medium->emits = medium->emits || !grid.temperature_k.empty();
  GetVelocityScale(parameters, medium);
  medium->kind = std::move(grid);
}

void SetRgbGrid(ParameterList& parameters, MediumDescription* medium) {
  RgbGridMedium grid;
  medium->sigma_a = medium->sigma_s = RgbColor(Rgb::Gray(1));
  if (GetBox(parameters, &grid.box)) {
    grid.sigma_a = GetColorCells(parameters, "sigma_a", grid.box, ColorRole::kUnbounded);
    grid.sigma_s = GetColorCells(parameters, "sigma_s", grid.box, ColorRole::kUnbounded);
    grid.radiance = GetColorCells(parameters, "Le", grid.box, ColorRole::kIlluminant);
  }
  if (!parameters.Has("sigma_a") && !parameters.Has("sigma_s")) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"rgb sigma_a\" or \"rgb sigma_s\""));
  }
  if (parameters.Has("Le") && !parameters.Has("sigma_a")) {
    parameters.ErrorAt(*parameters.Find("Le"),
                       "needs \"rgb sigma_a\" too, because media that emit also absorb");
  }
  if (const Parameter* radiance = parameters.Find("Le")) {
    parameters.diagnostics().Note(
        radiance->location, absl::StrCat(parameters.owner(),
                                         ": \"Le\" is a radiance, as in other media; pbrt-v4 has "
                                         "106.856 times the light in an rgbgrid alone: multiply "
                                         "\"Lescale\" by that for its image"));
  }
  GetRadianceScale(parameters, medium);
  medium->emits = !grid.radiance.empty();
  medium->kind = std::move(grid);
}

void SetCloud(ParameterList& parameters, SceneFiles& files, MediumDescription* medium) {
  CloudMedium cloud;
  GetCoefficients(parameters, files, medium);
  GetCorners(parameters, &cloud.p0, &cloud.p1);
  cloud.density = parameters.GetFloat("density", 1);
  cloud.wispiness = parameters.GetFloat("wispiness", 1);
  cloud.frequency = parameters.GetFloat("frequency", 5);
  for (const char* name : {"density", "wispiness", "frequency"}) {
    const Parameter* parameter = parameters.Find(name);
    if (parameter == nullptr || parameter->floats.empty()) continue;
    if (parameter->floats[0] >= 0 && std::isfinite(parameter->floats[0])) continue;
    parameters.ErrorAt(*parameter, "must be finite and 0 or more");
  }
  medium->kind = cloud;
}

void SetVolumeFile(ParameterList& parameters, SceneFiles& files, MediumDescription* medium) {
  VolumeFileMedium volume;
  GetCoefficients(parameters, files, medium);
  const std::string file = parameters.GetString("filename", "");
  if (file.empty()) {
    parameters.Error(absl::StrCat(parameters.owner(), " needs \"string filename\""));
  } else {
    volume.file = CanonicalFileName(file);
    volume.is_openvdb = absl::EndsWithIgnoreCase(volume.file, ".vdb");
    if (const auto path = files.LocalPath(volume.file); !path.ok()) {
      parameters.ErrorAt(*parameters.Find("filename"), std::string(path.status().message()));
    }
  }
  GetRadianceScale(parameters, medium);
  volume.emission = GetTemperatureEmission(parameters);
  volume.density_grid = parameters.GetString("gridname", volume.density_grid);
  if (parameters.Has("temperaturename")) {
    volume.temperature_grid = parameters.GetString("temperaturename", kTemperatureGrid);
  }
  volume.velocity_grid = parameters.GetString("velocity", "");
  if (volume.velocity_grid.empty() && parameters.Has("velocity")) {
    parameters.ErrorAt(*parameters.Find("velocity"),
                       absl::StrCat("must name a grid of the file, or \"", kAnyVelocityGrid, "\""));
  }
  GetVelocityScale(parameters, medium);
  // The file determines whether there are temperatures.
  medium->emits = medium->radiance_scale > 0;
  medium->kind = std::move(volume);
}

}  // namespace

void RequireCoefficient(ParameterList& parameters, const std::string& name, ColorSpec* color) {
  bool is_right = IsFinite(color->rgb) && std::min({color->rgb.r, color->rgb.g, color->rgb.b}) >= 0;
  for (const float value : color->values) is_right = is_right && std::isfinite(value) && value >= 0;
  if (is_right) return;
  parameters.ErrorAt(*parameters.Find(name), "must be finite and 0 or more everywhere");
  *color = {};
}

void GetScaleAndPhase(ParameterList& parameters, MediumDescription* medium) {
  medium->scale = parameters.GetFloat("scale", 1);
  if (!(medium->scale >= 0 && std::isfinite(medium->scale))) {
    parameters.ErrorAt(*parameters.Find("scale"), "must be finite and 0 or more");
    medium->scale = 1;
  }
  medium->g = parameters.GetFloat("g", 0);
  if (!(std::fabs(medium->g) <= kPhaseAsymmetryMax)) {
    parameters.ErrorAt(*parameters.Find("g"),
                       absl::StrCat("is ", medium->g, " but must lie in [", -kPhaseAsymmetryMax,
                                    ", ", kPhaseAsymmetryMax,
                                    "]: beyond, all light is scattered straight forward or back"));
    medium->g = 0;
  }
}

bool IsBlack(const std::vector<Rgb>& cells) {
  return !cells.empty() &&
         std::all_of(cells.begin(), cells.end(), [](Rgb cell) { return cell.IsBlack(); });
}

// Removes, and reports by name, grids that have no effect or emit nowhere.
void RemoveGridsWithoutEffect(ParameterList& parameters, MediumDescription* medium) {
  auto* grid = std::get_if<UniformGridMedium>(&medium->kind);
  if (grid != nullptr && !grid->temperature_k.empty()) {
    const auto [low, high] =
        std::minmax_element(grid->temperature_k.begin(), grid->temperature_k.end());
    // The scale may be negative.
    const float hottest = std::max(grid->emission.KelvinOf(*low), grid->emission.KelvinOf(*high));
    if (!(hottest > kEmissionTemperatureMinK)) {
      parameters.NoteWithoutEffect(
          "temperature", absl::StrCat("no cell is hotter than ", kEmissionTemperatureMinK, " K"));
      grid->temperature_k.clear();
      medium->emits = false;
    }
  }
  if (grid != nullptr && !grid->velocity.empty() &&
      std::all_of(grid->velocity.begin(), grid->velocity.end(),
                  [](Vec3f v) { return v == Vec3f{}; })) {
    parameters.NoteWithoutEffect("velocity", "it is 0 in all cells");
    grid->velocity.clear();
  }
  bool is_empty = false;
  if (grid != nullptr) {
    is_empty = !grid->density.empty() &&
               *std::max_element(grid->density.begin(), grid->density.end()) == 0;
  } else if (const auto* colors = std::get_if<RgbGridMedium>(&medium->kind)) {
    is_empty = IsBlack(colors->sigma_a) && IsBlack(colors->sigma_s);
  }
  if (!is_empty) return;
  parameters.Note(absl::StrCat(parameters.owner(), " has no effect: its grid is 0 in all cells"));
  medium->kind = HomogeneousMedium{};
  medium->sigma_a = medium->sigma_s = {};
  medium->emits = false;
}

bool SetMedium(const Matrix4& world_from_medium, ParameterList& parameters, SceneFiles& files,
               MediumDescription* medium) {
  medium->world_from_medium = world_from_medium;
  const std::string type = parameters.GetString("type", "");
  if (type == "homogeneous") {
    SetHomogeneous(parameters, files, medium);
  } else if (type == "uniformgrid") {
    SetUniformGrid(parameters, files, medium);
  } else if (type == "rgbgrid") {
    SetRgbGrid(parameters, medium);
  } else if (type == "cloud") {
    SetCloud(parameters, files, medium);
  } else if (type == "nanovdb" || type == "openvdb") {
    SetVolumeFile(parameters, files, medium);
  } else {
    parameters.Error(absl::StrCat(
        parameters.owner(),
        type.empty() ? " needs \"string type\""
                     : absl::StrCat(": type \"", type, "\" is not supported"),
        SupportedNamesHint(
            type, {"homogeneous", "uniformgrid", "rgbgrid", "cloud", "nanovdb", "openvdb"})));
    parameters.IgnoreAll();
    return false;
  }
  GetScaleAndPhase(parameters, medium);
  RemoveGridsWithoutEffect(parameters, medium);
  parameters.ReportUnused();
  return true;
}

}  // namespace sheaf
