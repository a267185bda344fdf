// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialTable's principled materials: Sheaf's own type.
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/statements/color_parameters.h"
#include "common/scene/pbrt/statements/material_table.h"

namespace sheaf {
namespace {

constexpr float kDefaultBaseColor = 0.8f;

}  // namespace

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
