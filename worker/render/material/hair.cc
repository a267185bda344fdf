// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/hair.h"

#include "absl/strings/str_cat.h"

namespace sheaf::render {
namespace {

// Absorption of the melanins at concentration 1, for light of the sRGB primaries. Source: d'Eon et
// al. 2011, "An Energy-Conserving Hair Reflectance Model", sec. 6.1, as in pbrt-v4.
constexpr Rgb kEumelaninAbsorption{0.419f, 0.697f, 1.37f};
constexpr Rgb kPheomelaninAbsorption{0.187f, 0.4f, 1.05f};

struct HairNumber {
  const char* name;
  const FloatInput& input;
  FloatOperand* operand;
  float low, high;
};

absl::Status SetHairColor(const HairMaterial& d, const TextureProgram& textures,
                          CompiledHair* hair) {
  if (d.pigment == HairMaterial::Pigment::kReflectance) return absl::OkStatus();
  if (d.pigment == HairMaterial::Pigment::kAbsorption) {
    hair->color = textures.Operand(d.color, ColorRole::kUnbounded);
    if (hair->color.texture != kNone || IsFinite(hair->color.value)) return absl::OkStatus();
    return absl::InvalidArgumentError("sigma_a must be a finite number");
  }
  ColorInput absorption;
  absorption.value.rgb = kEumelaninAbsorption;
  hair->eumelanin_absorption = textures.Operand(absorption, ColorRole::kUnbounded);
  absorption.value.rgb = kPheomelaninAbsorption;
  hair->pheomelanin_absorption = textures.Operand(absorption, ColorRole::kUnbounded);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CompiledHair> CompileHair(const HairMaterial& d, const TextureProgram& textures) {
  CompiledHair hair;
  hair.pigment = d.pigment;
  if (absl::Status status = SetHairColor(d, textures, &hair); !status.ok()) return status;
  constexpr float kConcentrationMax = HairMaterial::kConcentrationMax;
  const HairNumber numbers[] = {
      {"eumelanin", d.eumelanin, &hair.eumelanin, 0, kConcentrationMax},
      {"pheomelanin", d.pheomelanin, &hair.pheomelanin, 0, kConcentrationMax},
      {"eta", d.eta, &hair.eta, HairMaterial::kIndexMin, HairMaterial::kIndexMax},
      {"beta_m", d.beta_m, &hair.beta_m, 0, 1},
      {"beta_n", d.beta_n, &hair.beta_n, 0, 1},
      {"alpha", d.alpha_degrees, &hair.alpha_degrees, -90, 90}};
  for (const HairNumber& number : numbers) {
    *number.operand = textures.Operand(number.input);
    const float value = number.operand->value;
    if (number.operand->texture != kNone || (value >= number.low && value <= number.high)) continue;
    return absl::InvalidArgumentError(absl::StrCat(number.name, " ", value, " must lie in [",
                                                   number.low, ", ", number.high, "]"));
  }
  return hair;
}

}  // namespace sheaf::render
