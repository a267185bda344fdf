// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialTable's subsurface materials: a boundary, and matter by its coefficients, by the name of
// a measured substance, or by what it reflects.
#include <algorithm>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/scene/color_parameters.h"
#include "common/scene/half_space.h"
#include "common/scene/material_table.h"
#include "common/scene/medium_parameters.h"

namespace sheaf {
namespace {

constexpr float kDefaultSubsurfaceIndex = 1.33f;
// pbrt-v4's: milk's, per millimetre.
constexpr Rgb kDefaultSigmaA{.0011f, .0024f, .014f}, kDefaultSigmaS{2.55f, 3.21f, 3.77f};
// A free path of nothing would be infinitely dense.
constexpr float kFreePathMin = 1e-30f;

// Whether the parameter is there and no texture, which matter cannot be painted with.
bool HasColor(ParameterList& parameters, const char* name) {
  const Parameter* parameter = parameters.Find(name);
  if (parameter == nullptr) return false;
  if (parameter->type != ParameterType::kTexture) return true;
  parameters.ErrorAt(*parameter,
                     "is not supported as a texture: matter is the same everywhere beneath the "
                     "surface; give a color");
  return false;
}

void SetPreset(ParameterList& parameters, const std::string& name, MediumDescription* matter) {
  const MeasuredMedium* measured = FindMeasuredMedium(name);
  if (measured == nullptr) {
    parameters.ErrorAt(*parameters.Find("name"),
                       absl::StrCat("\"", name, "\" names no measured medium",
                                    NearestNameHint(name, MeasuredMediumNames())));
    return;
  }
  matter->sigma_a = RgbColor(measured->sigma_a);
  matter->sigma_s = RgbColor(measured->sigma_s);
  for (const char* other : {"sigma_a", "sigma_s", "reflectance", "mfp", "g"}) {
    parameters.NoteWithoutEffect(other, "the named substance says what it is");
  }
  matter->g = 0;  // What is measured are reduced coefficients.
}

// Coefficients by what even light would see of the matter, and its mean free path.
void SetReflectance(ParameterList& parameters, FileSource& files, float eta,
                    MediumDescription* matter) {
  const auto color_of = [&](const char* name, ColorRole role) {
    if (!HasColor(parameters, name)) return Rgb::Grey(1);
    const ColorSpec color = GetColor(parameters, name, role, RgbColor(Rgb::Grey(1)), files);
    if (color.kind != ColorSpec::Kind::kRgb) {
      parameters.diagnostics().Note(
          parameters.Find(name)->location,
          absl::StrCat(parameters.owner(), ": ", name, " is taken as its linear sRGB color"));
    }
    return color.rgb;
  };
  const Rgb reflectance = color_of("reflectance", ColorRole::kReflectance);
  Rgb free_path = color_of("mfp", ColorRole::kUnbounded) * matter->scale;
  if (!IsFinite(free_path) ||
      !(std::min({free_path.r, free_path.g, free_path.b}) >= kFreePathMin)) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  ": mfp times scale must be finite and more than ", kFreePathMin));
    free_path = Rgb::Grey(1);
  }
  matter->scale = 1;
  Rgb sigma_a, sigma_s;
  for (size_t c = 0; c < 3; ++c) {
    const double albedo =
        AlbedoForReflectance(static_cast<double>(reflectance[c]), static_cast<double>(eta),
                             static_cast<double>(matter->g));
    const double sigma_t = 1 / static_cast<double>(free_path[c]);
    sigma_s[c] = static_cast<float>(albedo * sigma_t);
    sigma_a[c] = static_cast<float>((1 - albedo) * sigma_t);
  }
  matter->sigma_a = RgbColor(sigma_a);
  matter->sigma_s = RgbColor(sigma_s);
}

}  // namespace

SubsurfaceMaterial MaterialTable::MakeSubsurface(ParameterList& parameters) {
  SubsurfaceMaterial material;
  material.roughness = GetRoughness(parameters);
  if (parameters.Has("eta"))
    material.eta = GetIndex(parameters);
  else
    material.eta.mean = kDefaultSubsurfaceIndex;
  MediumDescription matter;
  matter.name = parameters.owner();
  matter.location = parameters.location();
  matter.is_matter = true;
  GetScaleAndPhase(parameters, &matter);
  const std::string name = parameters.GetString("name", "");
  const bool has_a = HasColor(parameters, "sigma_a"), has_s = HasColor(parameters, "sigma_s");
  const bool has_reflectance = HasColor(parameters, "reflectance");
  matter.sigma_a = RgbColor(kDefaultSigmaA);
  matter.sigma_s = RgbColor(kDefaultSigmaS);
  if (!name.empty()) {
    SetPreset(parameters, name, &matter);
  } else if (has_a || has_s) {
    if (has_a != has_s) {
      parameters.Error(absl::StrCat(parameters.owner(), " needs both sigma_a and sigma_s"));
    }
    matter.sigma_a =
        GetColor(parameters, "sigma_a", ColorRole::kUnbounded, matter.sigma_a, *files_);
    matter.sigma_s =
        GetColor(parameters, "sigma_s", ColorRole::kUnbounded, matter.sigma_s, *files_);
    RequireCoefficient(parameters, "sigma_a", &matter.sigma_a);
    RequireCoefficient(parameters, "sigma_s", &matter.sigma_s);
    if (has_reflectance) {
      parameters.Error(absl::StrCat(parameters.owner(),
                                    ": reflectance excludes sigma_a and sigma_s; give one or the "
                                    "other"));
    }
    parameters.NoteWithoutEffect("mfp", "sigma_a and sigma_s say what it is");
  } else if (has_reflectance) {
    SetReflectance(parameters, *files_, material.eta.mean, &matter);
  } else {
    parameters.NoteWithoutEffect("mfp", "it goes with reflectance, which is not given");
  }
  material.medium = static_cast<int32_t>(matter_.size());
  matter_.push_back(std::move(matter));
  return material;
}

}  // namespace sheaf
