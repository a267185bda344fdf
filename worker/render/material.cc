// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"
#include "worker/render/fresnel.h"
#include "worker/render/material_impl.h"
#include "worker/render/variant_list.h"

namespace sheaf::render {
namespace {

// Where one direction is rough the other cannot be a perfect edge. The same floor as pbrt-v4's.
constexpr float kOtherAlphaMin = 1e-4f;
// Closer to 1 than this, the facet that joins two directions across the interface cannot be told
// from rounding, and refraction bends by less than a float direction resolves.
constexpr float kIndexDifferenceMin = 1e-4f;

// Keeps NaN, so that a texel that could not be read is noticed.
Rgb ClampReflectance(Rgb color) {
  for (size_t c = 0; c < 3; ++c) {
    color[c] = color[c] < 0 ? 0 : (color[c] > 1 ? 1 : color[c]);
  }
  return color;
}

float AlphaOfRoughness(float roughness, bool remap) {
  const float value = std::fmax(roughness, 0.0f);
  return remap ? std::sqrt(value) : value;
}

// Index and absorption of a conductor that reflects `reflectance` at normal incidence.
float AbsorptionOf(float reflectance) {
  if (reflectance >= 1) return kPerfectConductorK;
  return 2 * std::sqrt(reflectance / (1 - reflectance));
}

// The part of a table that serves alpha: its only row, or two neighbours of all.
template <typename Row>
const Row* ChooseRow(const std::vector<Row>* rows, float alpha, float* blend) {
  if (rows == nullptr) return nullptr;
  if (rows->size() == 1) return rows->data();
  const RowBlend at = FindAlphaRow(alpha);
  *blend = at.fraction;
  return rows->data() + at.index;
}

void SetAlpha(const CompiledMaterial& material, const SurfaceInputs& inputs, Bsdf* bsdf) {
  bsdf->alpha_x = AlphaOfRoughness(inputs.roughness_u, material.remap_roughness);
  bsdf->alpha_y = AlphaOfRoughness(inputs.roughness_v, material.remap_roughness);
  if (Ggx{bsdf->alpha_x, bsdf->alpha_y}.IsSmooth()) return;
  bsdf->alpha_x = std::fmax(bsdf->alpha_x, kOtherAlphaMin);
  bsdf->alpha_y = std::fmax(bsdf->alpha_y, kOtherAlphaMin);
}

void SetConductor(const CompiledMaterial& material, const SurfaceInputs& inputs, float alpha,
                  Bsdf* bsdf) {
  if (material.from_reflectance) {
    const Rgb r = ClampReflectance(inputs.color);
    bsdf->eta_rgb = Rgb::Grey(1);
    bsdf->k_rgb = {AbsorptionOf(r.r), AbsorptionOf(r.g), AbsorptionOf(r.b)};
  } else {
    bsdf->eta_rgb = inputs.eta;
    bsdf->k_rgb = inputs.k;
  }
  bsdf->albedo = FresnelConductor(1, bsdf->eta_rgb, bsdf->k_rgb);
  if (bsdf->specular) return;
  bsdf->conductor_energy = ChooseRow(material.conductor_rows, alpha, &bsdf->blend);
  if (bsdf->conductor_energy == nullptr) return;
  // Light that was shadowed has been reflected once and is again each time it fails to leave.
  // Source: Hill 2018, "A Multi-Faceted Exploration", part 3.
  float loss = bsdf->conductor_energy[0].lobe.average_loss;
  if (bsdf->blend > 0) {
    loss += bsdf->blend * (bsdf->conductor_energy[1].lobe.average_loss - loss);
  }
  const Rgb average = AverageConductorFresnel(bsdf->eta_rgb, bsdf->k_rgb);
  for (size_t c = 0; c < 3; ++c) {
    bsdf->color[c] = average[c] * average[c] * (1 - loss) / (1 - average[c] * loss);
  }
}

}  // namespace

Bsdf MakeBsdf(const CompiledMaterial& material, const SurfaceInputs& inputs) {
  Bsdf bsdf;
  bsdf.kind = material.kind;
  bsdf.eta = material.eta;
  bsdf.albedo = Rgb::Grey(1);
  SetAlpha(material, inputs, &bsdf);
  const bool is_smooth = Ggx{bsdf.alpha_x, bsdf.alpha_y}.IsSmooth();
  const float alpha = EquivalentAlpha({bsdf.alpha_x, bsdf.alpha_y});
  switch (material.kind) {
    case BsdfKind::kDiffuse:
      bsdf.color = bsdf.albedo = ClampReflectance(inputs.color);
      break;
    case BsdfKind::kConductor:
      bsdf.specular = is_smooth;
      SetConductor(material, inputs, alpha, &bsdf);
      break;
    case BsdfKind::kDielectric:
      bsdf.specular = is_smooth || std::fabs(bsdf.eta - 1) < kIndexDifferenceMin;
      if (!bsdf.specular) {
        bsdf.dielectric_energy = ChooseRow(material.dielectric_rows, alpha, &bsdf.blend);
      }
      break;
    case BsdfKind::kCoatedDiffuse:
      bsdf.color = bsdf.albedo = ClampReflectance(inputs.color);
      bsdf.coat = ChooseRow(material.coat_rows, alpha, &bsdf.blend);
      break;
    case BsdfKind::kThinDielectric:
    case BsdfKind::kInterface:
      bsdf.specular = true;
      break;
    case BsdfKind::kBlack:
      bsdf.albedo = {};
      break;
  }
  return bsdf;
}

MaterialTable::MaterialTable() : impl_(std::make_unique<Impl>()) {}
MaterialTable::~MaterialTable() = default;

namespace {

SurfaceInputs InputsAt(const TextureProgram& textures, const CompiledMaterial& material,
                       const TexturePoint& point) {
  return {textures.Color(material.color, point), textures.Color(material.eta_rgb, point),
          textures.Color(material.k_rgb, point), textures.Float(material.roughness_u, point),
          textures.Float(material.roughness_v, point)};
}

// Follows mixes down to a material, spending u without losing its uniformity.
const CompiledMaterial& Choose(const std::vector<CompiledMaterial>& materials,
                               const TextureProgram& textures, int32_t material,
                               const TexturePoint& point, float u) {
  const CompiledMaterial* chosen = &materials[static_cast<size_t>(material)];
  while (chosen->is_mix) {
    const float amount = std::clamp(textures.Float(chosen->amount, point), 0.0f, 1.0f);
    const bool second = u < amount;
    u = second ? u / amount : (u - amount) / (1 - amount);
    u = std::fmin(u, 0x1.fffffep-1f);
    chosen = &materials[static_cast<size_t>(chosen->mix[second ? 1 : 0])];
  }
  return *chosen;
}

}  // namespace

template <uint32_t kTraits>
Bsdf MaterialTable::Evaluate(int32_t material, const TexturePoint& point, float u_mix) const {
  if (material == kNone) return Bsdf{.kind = BsdfKind::kInterface, .specular = true};
  const CompiledMaterial* chosen = &impl_->materials[static_cast<size_t>(material)];
  if constexpr (Has(kTraits, Trait::kAlpha)) {
    if (chosen->is_mix) {
      chosen = &Choose(impl_->materials, *impl_->textures, material, point, u_mix);
    }
  }
  if constexpr (Has(kTraits, Trait::kTextures)) {
    if (chosen->varies) return MakeBsdf(*chosen, InputsAt(*impl_->textures, *chosen, point));
  }
  return chosen->constant;
}

template <uint32_t kTraits>
float MaterialTable::EvaluateFloat(const FloatInput& input, const TexturePoint& point) const {
  if constexpr (Has(kTraits, Trait::kTextures)) {
    return impl_->textures->Float(impl_->textures->Operand(input), point);
  }
  return impl_->textures->Operand(input).value;
}

#define SHEAF_INSTANTIATE_MATERIAL(name, traits)                                             \
  template Bsdf MaterialTable::Evaluate<traits>(int32_t material, const TexturePoint& point, \
                                                float u_mix) const;                          \
  template float MaterialTable::EvaluateFloat<traits>(const FloatInput& input,               \
                                                      const TexturePoint& point) const;
SHEAF_RENDER_VARIANTS(SHEAF_INSTANTIATE_MATERIAL)
#undef SHEAF_INSTANTIATE_MATERIAL

}  // namespace sheaf::render
