// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The materials of MaterialTable that have models of their own: hair, measured and principled.
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/formats/measured_file.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/material_table.h"

namespace sheaf {
namespace {

// A coat is not sampled on its own.
void NoteCoatSampling(ParameterList& parameters) {
  for (const char* name : {"maxdepth", "nsamples"}) {
    if (parameters.GetInteger(name, 1) < 1) {
      parameters.ErrorAt(*parameters.Find(name), "must be at least 1");
    }
  }
  parameters.NoteWithoutEffect("maxdepth",
                               "a coat keeps light however often it is reflected inside");
  parameters.NoteWithoutEffect("nsamples", "a coat is computed without samples of its own");
}

constexpr float kDefaultBaseColor = 0.8f;

}  // namespace

void MaterialTable::GetCoat(ParameterList& parameters, const std::string& eta_name,
                            ClearCoat* coat) {
  const RefractiveIndex eta = GetIndex(parameters, eta_name);
  coat->eta = eta.mean;
  if (eta.Disperses()) {
    diagnostics_->Note(parameters.Find(eta_name)->location,
                       absl::StrCat(parameters.owner(), ": ", eta_name,
                                    " varies with wavelength; a coat uses its mean ", coat->eta));
  }
  coat->thickness = GetConstant(parameters, "thickness", 0.01f);
  coat->g = GetConstant(parameters, "g", 0);
  coat->albedo = textures_->GetColorInput(parameters, "albedo", ColorRole::kReflectance,
                                          RgbColor(Rgb::Gray(0)));
  if (coat->albedo.texture != kNone || !coat->albedo.value.rgb.IsBlack()) {
    parameters.ErrorAt(*parameters.Find("albedo"),
                       "is not supported unless 0: the coat has no scattering medium yet");
  }
  NoteCoatSampling(parameters);
  if (!(coat->thickness >= 0)) parameters.Error(parameters.owner() + ": thickness is negative");
}

HairMaterial MaterialTable::MakeHair(ParameterList& parameters) {
  HairMaterial hair;
  const auto number = [&](const char* name, FloatInput* input, float low, float high) {
    *input = textures_->GetFloatInput(parameters, name, input->value);
    if (input->texture != kNone || (input->value >= low && input->value <= high)) return;
    parameters.ErrorAt(
        *parameters.Find(name),
        absl::StrCat("is ", input->value, " but must lie in [", low, ", ", high, "]"));
  };
  const std::string reflectance = parameters.Has("reflectance") ? "reflectance" : "color";
  if (parameters.Has("sigma_a")) {
    hair.pigment = HairMaterial::Pigment::kAbsorption;
    hair.color = textures_->GetColorInput(parameters, "sigma_a", ColorRole::kUnbounded,
                                          RgbColor(Rgb::Gray(0)));
  } else if (parameters.Has(reflectance)) {
    hair.pigment = HairMaterial::Pigment::kReflectance;
    hair.color = textures_->GetColorInput(parameters, reflectance, ColorRole::kReflectance,
                                          RgbColor(Rgb::Gray(0.5f)));
  } else if (parameters.Has("eumelanin") || parameters.Has("pheomelanin")) {
    hair.eumelanin.value = 0;
    number("eumelanin", &hair.eumelanin, 0, HairMaterial::kConcentrationMax);
    number("pheomelanin", &hair.pheomelanin, 0, HairMaterial::kConcentrationMax);
  }
  if (hair.pigment != HairMaterial::Pigment::kMelanin) {
    const bool is_absorption = hair.pigment == HairMaterial::Pigment::kAbsorption;
    const std::string taken = is_absorption ? "sigma_a" : reflectance;
    for (const char* name : {"reflectance", "color", "eumelanin", "pheomelanin"}) {
      if (name != taken) parameters.NoteWithoutEffect(name, taken + " is given");
    }
  }
  number("eta", &hair.eta, HairMaterial::kIndexMin, HairMaterial::kIndexMax);
  number("beta_m", &hair.beta_m, 0, 1);
  number("beta_n", &hair.beta_n, 0, 1);
  number("alpha", &hair.alpha_degrees, -90, 90);
  return hair;
}

MeasuredMaterial MaterialTable::MakeMeasured(ParameterList& parameters) {
  MeasuredMaterial measured;
  const std::string name = parameters.GetString("filename", "");
  if (name.empty()) {
    parameters.Error(
        absl::StrCat(parameters.owner(), " needs \"string filename\", a .bsdf file of the RGL"));
    return measured;
  }
  measured.file = CanonicalFileName(name);
  const Parameter& parameter = *parameters.Find("filename");
  const absl::StatusOr<const MeasuredShape*> shape = files_->MeasuredShapeOf(measured.file);
  if (!shape.ok()) {
    parameters.ErrorAt(parameter, absl::StrCat("cannot be read: ", shape.status().message()));
    return measured;
  }
  measured.is_anisotropic = (*shape)->phi_count > 1;
  return measured;
}

PrincipledMaterial MaterialTable::MakePrincipled(ParameterList& parameters) {
  PrincipledMaterial material;
  const auto color = [&](const char* name, float fallback) {
    return textures_->GetColorInput(parameters, name, ColorRole::kReflectance,
                                    RgbColor(Rgb::Gray(fallback)));
  };
  material.base_color = color("base_color", kDefaultBaseColor);
  material.specular_tint = color("specular_tint", 1);
  material.sheen_color = color("sheen_color", 0);
  PrincipledMaterial::ForEachNumber(
      material, [&](const char* name, auto& input, float low, float high) {
        float value = 0;
        if constexpr (std::is_same_v<std::decay_t<decltype(input)>, FloatInput>) {
          input = textures_->GetFloatInput(parameters, name, input.value);
          if (input.texture != kNone) return;
          value = input.value;
        } else {
          value = input = GetConstant(parameters, name, input);
        }
        if (value >= low && value <= high) return;
        parameters.ErrorAt(*parameters.Find(name),
                           absl::StrCat("is ", value, " but must lie in [", low, ", ", high, "]"));
      });
  material.thin = parameters.GetBool("thin", false);
  GetInterior(parameters, &material);
  material.emission =
      GetColor(parameters, "emission", ColorRole::kIlluminant, RgbColor({}), *files_);
  material.emission_strength = GetConstant(parameters, "emission_strength", 1);
  if (!(material.emission_strength >= 0) || !std::isfinite(material.emission_strength)) {
    parameters.ErrorAt(
        *parameters.Find("emission_strength"),
        absl::StrCat("is ", material.emission_strength, " but must be 0 or more, and finite"));
  }
  return material;
}

void MaterialTable::GetInterior(ParameterList& parameters, PrincipledMaterial* material) {
  material->attenuation_color = GetColor(parameters, "attenuation_color", ColorRole::kReflectance,
                                         RgbColor(Rgb::Gray(1)), *files_);
  if (!parameters.Has("attenuation_distance")) {
    parameters.NoteWithoutEffect("attenuation_color", "attenuation_distance is not given");
    return;
  }
  const float distance = GetConstant(parameters, "attenuation_distance", 0);
  if (!(distance > 0)) {
    parameters.ErrorAt(*parameters.Find("attenuation_distance"),
                       absl::StrCat("is ", distance, " but must be more than 0"));
    return;
  }
  if (material->thin) {
    for (const char* name : {"attenuation_color", "attenuation_distance"}) {
      parameters.NoteWithoutEffect(name, "a thin sheet has no inside");
    }
    return;
  }
  if (std::isfinite(distance)) material->attenuation_distance = distance;
}

MaterialDescription MaterialTable::WithAlpha(MaterialDescription description) {
  const auto* principled = std::get_if<PrincipledMaterial>(&description.material);
  if (principled == nullptr) return description;
  const FloatInput alpha = principled->alpha;
  if (alpha.texture == kNone && alpha.value == 1) return description;
  MixMaterial mix;
  mix.amount = alpha;
  MaterialDescription nothing;
  nothing.material = InterfaceMaterial{};
  nothing.location = description.location;
  mix.material[0] = static_cast<int32_t>(scene_->materials.size());
  mix.material[1] = mix.material[0] + 1;
  MaterialDescription whole;
  whole.material = mix;
  whole.location = description.location;
  scene_->materials.push_back(std::move(nothing));
  scene_->materials.push_back(std::move(description));
  return whole;
}

}  // namespace sheaf
