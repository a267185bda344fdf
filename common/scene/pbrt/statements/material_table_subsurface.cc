// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialTable's subsurface materials: a boundary, and an interior given by its coefficients, by
// the name of a measured substance, or by its reflectance.
#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/material_table.h"
#include "common/scene/pbrt/statements/medium_parameters.h"
#include "common/scene/pbrt/statements/subsurface_reflectance.h"

namespace sheaf {
namespace {

constexpr float kDefaultSubsurfaceIndex = 1.33f;
// pbrt-v4's defaults: milk's, per millimeter.
constexpr Rgb kDefaultSigmaA{.0011f, .0024f, .014f}, kDefaultSigmaS{2.55f, 3.21f, 3.77f};
// Whether the parameter is present and not a texture, which interiors do not support.
bool HasColor(ParameterList& parameters, const char* name) {
  const Parameter* parameter = parameters.Find(name);
  if (parameter == nullptr) return false;
  if (parameter->type != ParameterType::kTexture) return true;
  parameters.ErrorAt(*parameter,
                     "is not supported as a texture; give a color, or paint the reflectance");
  return false;
}

void SetPreset(ParameterList& parameters, const std::string& name, MediumDescription* subsurface) {
  const MeasuredMedium* measured = FindMeasuredMedium(name);
  if (measured == nullptr) {
    parameters.ErrorAt(*parameters.Find("name"),
                       absl::StrCat("\"", name, "\" names no measured medium",
                                    NearestNameHint(name, MeasuredMediumNames())));
    return;
  }
  subsurface->sigma_a = RgbColor(measured->sigma_a);
  subsurface->sigma_s = RgbColor(measured->sigma_s);
  for (const char* other : {"sigma_a", "sigma_s", "reflectance", "mfp", "g"}) {
    parameters.NoteWithoutEffect(other, "the named substance defines it");
  }
  subsurface->g = 0;  // The measured values are reduced coefficients.
}

// Whether the spectrum consists of valid free paths. If it is sampled, its rgb alone does not show
// that.
bool IsFreePath(const ColorSpec& color, float scale) {
  const auto is_length = [scale](float value) {
    return std::isfinite(value * scale) && value * scale >= kFreePathMin;
  };
  return is_length(color.rgb.r) && is_length(color.rgb.g) && is_length(color.rgb.b) &&
         std::all_of(color.values.begin(), color.values.end(), is_length);
}

// The interior's reflectance under uniform light and its mean free path. Its coefficients follow
// once the scene is read, since they take milliseconds.
void GetReflectance(ParameterList& parameters, TextureTable& textures, SceneFiles& files, float eta,
                    MediumDescription* subsurface) {
  SubsurfaceReflectance reflectance;
  const ColorInput color = textures.GetColorInput(parameters, "reflectance",
                                                  ColorRole::kReflectance, RgbColor(Rgb::Gray(1)));
  reflectance.color = color.value;
  reflectance.texture = color.texture;
  reflectance.free_path =
      HasColor(parameters, "mfp")
          ? GetColor(parameters, "mfp", ColorRole::kUnbounded, RgbColor(Rgb::Gray(1)), files)
          : RgbColor(Rgb::Gray(1));
  reflectance.scale = subsurface->scale;
  reflectance.eta = eta;
  if (!IsFreePath(reflectance.free_path, reflectance.scale)) {
    parameters.Error(absl::StrCat(parameters.owner(),
                                  ": mfp times scale must be finite and more than ", kFreePathMin));
    return;
  }
  subsurface->reflectance = reflectance;
}

}  // namespace

SubsurfaceMaterial MaterialTable::MakeSubsurface(ParameterList& parameters) {
  SubsurfaceMaterial material;
  material.roughness = GetRoughness(parameters);
  if (parameters.Has("eta"))
    material.eta = GetIndex(parameters);
  else
    material.eta.mean = kDefaultSubsurfaceIndex;
  MediumDescription subsurface;
  subsurface.name = parameters.owner();
  subsurface.location = parameters.location();
  subsurface.is_subsurface = true;
  GetScaleAndPhase(parameters, &subsurface);
  const std::string name = parameters.GetString("name", "");
  const bool has_a = HasColor(parameters, "sigma_a"), has_s = HasColor(parameters, "sigma_s");
  const bool has_reflectance = parameters.Has("reflectance");
  subsurface.sigma_a = RgbColor(kDefaultSigmaA);
  subsurface.sigma_s = RgbColor(kDefaultSigmaS);
  if (!name.empty()) {
    SetPreset(parameters, name, &subsurface);
  } else if (has_a || has_s) {
    if (has_a != has_s) {
      parameters.Error(absl::StrCat(parameters.owner(), " needs both sigma_a and sigma_s"));
    }
    subsurface.sigma_a =
        GetColor(parameters, "sigma_a", ColorRole::kUnbounded, subsurface.sigma_a, *files_);
    subsurface.sigma_s =
        GetColor(parameters, "sigma_s", ColorRole::kUnbounded, subsurface.sigma_s, *files_);
    RequireCoefficient(parameters, "sigma_a", &subsurface.sigma_a);
    RequireCoefficient(parameters, "sigma_s", &subsurface.sigma_s);
    if (has_reflectance) {
      parameters.Error(absl::StrCat(parameters.owner(),
                                    ": reflectance excludes sigma_a and sigma_s; give one or the "
                                    "other"));
    }
    parameters.NoteWithoutEffect("mfp", "sigma_a and sigma_s define it");
  } else if (has_reflectance) {
    GetReflectance(parameters, *textures_, *files_, material.eta.mean, &subsurface);
  } else {
    parameters.NoteWithoutEffect("mfp", "it goes with reflectance, which is not given");
  }
  material.medium = static_cast<int32_t>(subsurface_.size());
  subsurface_.push_back(std::move(subsurface));
  return material;
}

}  // namespace sheaf
