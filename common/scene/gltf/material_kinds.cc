// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Materials for materials of another kind than the core format's: those of
// KHR_materials_pbrSpecularGlossiness, and glass that disperses (KHR_materials_dispersion).
#include <algorithm>
#include <cmath>
#include <variant>

#include "common/scene/gltf/materials.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

// The reflectance at normal incidence of the greatest index.
constexpr float kReflectanceMax = 0.669421f;

float Greatest(Rgb c) { return std::max({c.r, c.g, c.b}); }

// The index of the dielectric that reflects this at normal incidence.
float IndexOfReflectance(float reflectance) {
  const float root = std::sqrt(std::min(reflectance, kReflectanceMax));
  return std::clamp((1 + root) / (1 - root), PrincipledMaterial::kIndexMin,
                    PrincipledMaterial::kIndexMax);
}

Rgb ClampedToOne(Rgb c) { return {std::min(c.r, 1.0f), std::min(c.g, 1.0f), std::min(c.b, 1.0f)}; }

bool IsWhite(const ColorInput& input) {
  return input.texture == kNone && input.value.rgb == Rgb::Gray(1);
}
bool Is(const FloatInput& input, float value) {
  return input.texture == kNone && input.value == value;
}

// Wavelengths at which the index is sampled, in nm.
constexpr int kFirstNm = 360, kLastNm = 830, kStepNm = 10;
// Fraunhofer's lines d, F and C, in nm.
constexpr double kLineD = 587.56, kLineF = 486.13, kLineC = 656.27;

// Cauchy's equation n = a + b / wavelength^2 for the index at line d and the Abbe number
// V = (n_d - 1) / (n_F - n_C) = 20 / dispersion. Source: KHR_materials_dispersion.
ColorSpec IndexSpectrum(double index, double dispersion) {
  const double spread = (index - 1) * dispersion / 20;
  const double b = spread / (1 / (kLineF * kLineF) - 1 / (kLineC * kLineC));
  const double a = index - b / (kLineD * kLineD);
  ColorSpec spectrum;
  spectrum.kind = ColorSpec::Kind::kSampled;
  for (int nm = kFirstNm; nm <= kLastNm; nm += kStepNm) {
    spectrum.wavelengths_nm.push_back(static_cast<float>(nm));
    const double value = std::max(a + b / (static_cast<double>(nm) * nm), 1.0);
    spectrum.values.push_back(static_cast<float>(value));
  }
  spectrum.rgb = Rgb::Gray(static_cast<float>(index));
  return spectrum;
}

}  // namespace

// The archived extension's specular color is the reflectance at normal incidence of any surface: of
// a dielectric of that index, or of a metal where no index has it.
void Materials::SetSpecularGlossiness(const tinygltf::Material& source, const std::string& what,
                                      PrincipledMaterial* material) {
  const tinygltf::Value* gloss = Find(source.extensions, "KHR_materials_pbrSpecularGlossiness");
  if (gloss == nullptr) return;
  const Rgb specular = ClampedToOne(ColorOf(gloss, "specularFactor", Rgb::Gray(1)));
  const auto glossiness =
      static_cast<float>(std::clamp(NumberOf(gloss, "glossinessFactor", 1), 0.0, 1.0));
  const TextureRef both = RefOf(gloss, "specularGlossinessTexture");
  material->metallic.value = 0;
  material->roughness = Number(glossiness, both, 3, what + ", glossiness");
  material->roughness.value = 1 - glossiness;
  if (material->roughness.texture != kNone) {
    auto& texture = scene_->textures[static_cast<size_t>(material->roughness.texture)].texture;
    std::get<ImageTexture>(texture).invert = true;
  }
  const float greatest = Greatest(specular);
  if (!both.IsSet() && greatest > kReflectanceMax) {
    material->metallic.value = 1;
    material->base_color = {.value = Color(specular)};
    return;
  }
  if (greatest == 0) {
    material->specular.value = 0;
    return;
  }
  material->ior = IndexOfReflectance(greatest);
  const float reflectance = std::min(greatest, kReflectanceMax);
  material->specular_tint = ColorTimes(specular * (1 / reflectance), both, what + ", specular");
  material->specular_tint.value = Color(ClampedToOne(specular * (1 / reflectance)));
  if (both.IsSet() && greatest > kReflectanceMax) {
    Ignore(what,
           "metals of KHR_materials_pbrSpecularGlossiness reflect two thirds at most; convert it: "
           "gltf-transform metalrough in.glb out.glb");
  }
}

// A base color tints glass where light enters and where it leaves; a dielectric has none.
void Materials::AbsorbBaseColor(const tinygltf::Material& source, const std::string& what,
                                PrincipledMaterial* m) {
  const tinygltf::Value* volume = Find(source.extensions, "KHR_materials_volume");
  const double thickness = NumberOf(volume, "thicknessFactor", 0);
  const auto distance = static_cast<double>(m->attenuation_distance);
  Rgb left = m->attenuation_color.rgb;
  for (size_t c = 0; c < 3; ++c) {
    const double before =
        distance > 0 ? std::pow(static_cast<double>(left[c]), thickness / distance) : 1;
    const auto base = static_cast<double>(m->base_color.value.rgb[c]);
    left[c] = static_cast<float>(before * base * base);
  }
  m->attenuation_color = Color(left);
  m->attenuation_distance = static_cast<float>(thickness);
  Ignore(what, "its base color is absorbed along its thickness, as it disperses");
}

void Materials::NoteDispersion(const tinygltf::Material& source, const std::string& what,
                               PrincipledMaterial* material) {
  const PrincipledMaterial& m = *material;
  const tinygltf::Value* extension = Find(source.extensions, "KHR_materials_dispersion");
  const double dispersion = NumberOf(extension, "dispersion", 0);
  if (!(dispersion > 0) || m.ior == 1) return;
  const bool is_glass = Is(m.transmission, 1) && !m.thin && Is(m.metallic, 0);
  const bool is_plain = m.base_color.texture == kNone && m.roughness.texture == kNone &&
                        Is(m.specular, 1) && IsWhite(m.specular_tint) && Is(m.coat, 0) &&
                        Is(m.iridescence, 0) && m.sheen_color.texture == kNone &&
                        m.sheen_color.value.rgb.IsBlack();
  if (is_glass && is_plain) {
    if (!IsWhite(m.base_color)) AbsorbBaseColor(source, what, material);
    dispersive_.emplace_back(static_cast<int32_t>(scene_->materials.size()), dispersion);
  } else {
    Ignore(what,
           "its dispersion has no effect: only glass with a volume, without textures and layers, "
           "disperses");
  }
}

void Materials::MakeDispersive() {
  for (const auto& [index, dispersion] : dispersive_) {
    MaterialDescription& description = scene_->materials[static_cast<size_t>(index)];
    const PrincipledMaterial source = std::get<PrincipledMaterial>(description.material);
    const float alpha = source.roughness.value * source.roughness.value;
    DielectricMaterial glass;
    glass.roughness = {.u = {.value = alpha}, .v = {.value = alpha}, .remap_roughness = false};
    glass.eta.mean = source.ior;
    glass.eta.spectrum = IndexSpectrum(static_cast<double>(source.ior), dispersion);
    description.material = glass;
  }
}

}  // namespace sheaf::gltf
