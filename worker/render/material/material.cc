// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/material/material.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"
#include "common/base/vector_bytes.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/hair_lobe.h"
#include "worker/render/material/material_impl.h"
#include "worker/render/traits/ablated_variants.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

// Where one direction is rough, the other cannot be perfectly smooth. The same minimum as
// pbrt-v4's.
constexpr float kOtherAlphaMin = 1e-4f;
// For indices closer to 1 than this, the half vector of refraction is dominated by rounding, and
// refraction bends by less than a float direction resolves.
constexpr float kIndexDifferenceMin = 1e-4f;

// Keeps NaN, so that an unreadable texel is noticed.
template <typename Color>
Color ClampReflectance(const Color& color) {
  return MakeColor<Color>(
      [&](size_t c) { return color[c] < 0 ? 0 : (color[c] > 1 ? 1 : color[c]); });
}

float AlphaOfRoughness(float roughness, bool remap) {
  const float value = std::max(0.0f, roughness);
  return remap ? std::sqrt(value) : value;
}

// Returns the part of a table for alpha: its only row, or two neighbors in a full table.
template <typename Row>
const Row* ChooseRow(const std::vector<Row>* rows, float alpha, float* blend) {
  if (rows == nullptr) return nullptr;
  if (rows->size() == 1) return rows->data();
  const RowBlend at = FindAlphaRow(alpha);
  *blend = at.fraction;
  return rows->data() + at.index;
}

void SetAlpha(const CompiledMaterial& material, float roughness_u, float roughness_v,
              BsdfShape* bsdf) {
  bsdf->alpha_x = AlphaOfRoughness(roughness_u, material.remap_roughness);
  bsdf->alpha_y = AlphaOfRoughness(roughness_v, material.remap_roughness);
  if (Ggx{bsdf->alpha_x, bsdf->alpha_y}.IsSmooth()) return;
  bsdf->alpha_x = std::max(kOtherAlphaMin, bsdf->alpha_x);
  bsdf->alpha_y = std::max(kOtherAlphaMin, bsdf->alpha_y);
}

template <typename Color>
void SetSheet(const CompiledMaterial& material, const SurfaceInputs<Color>& inputs,
              BsdfOf<Color>* bsdf) {
  bsdf->color = ClampReflectance(inputs.color * material.scale);
  bsdf->conductor_eta = ClampReflectance(inputs.eta * material.scale);
}

template <typename Color>
void SetComplexIndex(const CompiledMaterial& material, const SurfaceInputs<Color>& inputs,
                     BsdfOf<Color>* bsdf) {
  if (material.from_reflectance) {
    const Color r = ClampReflectance(inputs.color);
    bsdf->conductor_eta = Color::Gray(1);
    bsdf->conductor_k = MakeColor<Color>([&](size_t c) { return AbsorptionOf(r[c]); });
  } else {
    bsdf->conductor_eta = inputs.eta;
    bsdf->conductor_k = inputs.k;
  }
}

template <typename Color>
void SetConductor(const CompiledMaterial& material, const SurfaceInputs<Color>& inputs, float alpha,
                  BsdfOf<Color>* bsdf) {
  SetComplexIndex(material, inputs, bsdf);
  bsdf->albedo = FresnelConductor(1, bsdf->conductor_eta, bsdf->conductor_k);
  if (bsdf->specular) return;
  bsdf->conductor_energy = ChooseRow(material.conductor_rows, alpha, &bsdf->blend);
  if (bsdf->conductor_energy == nullptr) return;
  float loss = bsdf->conductor_energy[0].lobe.average_loss;
  if (bsdf->blend > 0) {
    loss += bsdf->blend * (bsdf->conductor_energy[1].lobe.average_loss - loss);
  }
  const Color average = AverageConductorFresnel(bsdf->conductor_eta, bsdf->conductor_k);
  bsdf->color = MakeColor<Color>([&](size_t c) { return TintOfReturn(average[c], loss); });
}

// Sets everything but the tint of the remainder lobe.
template <typename Color>
void SetCoatedConductor(const CompiledMaterial& material, const SurfaceInputs<Color>& inputs,
                        BsdfOf<Color>* bsdf) {
  SetComplexIndex(material, inputs, bsdf);
  const float eta = material.eta;
  bsdf->conductor_eta =
      MakeColor<Color>([&](size_t c) { return AgainstCoat(bsdf->conductor_eta[c], eta); });
  bsdf->conductor_k =
      MakeColor<Color>([&](size_t c) { return AgainstCoat(bsdf->conductor_k[c], eta); });
}

// The albedo of smooth layers at normal incidence.
template <typename Color>
Color CoatedConductorAlbedo(const BsdfOf<Color>& bsdf) {
  const float outside = FresnelDielectric(1, bsdf.eta).reflectance;
  const Color base = FresnelConductor(1, bsdf.conductor_eta, bsdf.conductor_k);
  return MakeColor<Color>([&](size_t c) {
    return outside + (1 - outside) * (1 - outside) * base[c] / (1 - outside * base[c]);
  });
}

}  // namespace

template <typename Color>
BsdfOf<Color> MakeBsdf(const CompiledMaterial& material, const SurfaceInputs<Color>& inputs) {
  BsdfOf<Color> bsdf;
  bsdf.kind = material.kind;
  bsdf.eta = material.eta;
  bsdf.albedo = Color::Gray(1);
  SetAlpha(material, inputs.roughness_u, inputs.roughness_v, &bsdf);
  const bool is_smooth = Ggx{bsdf.alpha_x, bsdf.alpha_y}.IsSmooth();
  const float alpha = EquivalentAlpha({bsdf.alpha_x, bsdf.alpha_y});
  switch (material.kind) {
    case BsdfKind::kDiffuseTransmission:
      SetSheet(material, inputs, &bsdf);
      bsdf.albedo = ClampReflectance(bsdf.color + bsdf.conductor_eta);
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
    case BsdfKind::kCoatedConductor:
      SetCoatedConductor(material, inputs, &bsdf);
      bsdf.albedo = CoatedConductorAlbedo(bsdf);
      bsdf.conductor_coat = material.conductor_coat;
      bsdf.specular = material.conductor_coat->is_smooth;
      if (!bsdf.specular) {
        const Color average = AverageConductorFresnel(bsdf.conductor_eta, bsdf.conductor_k);
        bsdf.color =
            MakeColor<Color>([&](size_t c) { return material.conductor_coat->Tint(average[c]); });
      }
      break;
    case BsdfKind::kThinDielectric:
    case BsdfKind::kInterface:
      bsdf.specular = true;
      break;
    case BsdfKind::kHair:  // These three are created at each hit.
    case BsdfKind::kMeasured:
    case BsdfKind::kPrincipled:
    case BsdfKind::kBlack:
      bsdf.albedo = {};
      break;
    default:  // Described materials.
      bsdf.color = bsdf.albedo = ClampReflectance(inputs.color);
  }
  return bsdf;
}
template Bsdf MakeBsdf(const CompiledMaterial&, const SurfaceInputs<Rgb>&);

MaterialTable::MaterialTable() : impl_(std::make_unique<Impl>()) {}
MaterialTable::~MaterialTable() = default;

namespace {

template <typename Color>
SurfaceInputs<Color> InputsAt(const TextureProgram& textures, const CompiledMaterial& material,
                              const TexturePoint& point, const WavelengthsOf<Color>& wavelengths) {
  const auto value = [&](const ColorOperand& operand) {
    return textures.Value<Color>(operand, point, wavelengths);
  };
  return {value(material.color), value(material.conductor_eta), value(material.conductor_k),
          textures.Float(material.roughness_u, point), textures.Float(material.roughness_v, point)};
}

const Bsdf& ConstantAt(const CompiledMaterial& material, NoWavelengths) {
  return material.constant;
}
// Everything but the colors is the same for every wavelength.
BsdfOf<Spectral> ConstantAt(const CompiledMaterial& material, const Wavelengths& wavelengths) {
  BsdfOf<Spectral> bsdf;
  static_cast<BsdfShape&>(bsdf) = material.constant;
  SurfaceInputs<Spectral> inputs;
  inputs.color = material.color.spectrum.At(wavelengths);
  switch (material.kind) {
    case BsdfKind::kConductor:
      inputs.eta = material.conductor_eta.spectrum.At(wavelengths);
      inputs.k = material.conductor_k.spectrum.At(wavelengths);
      SetComplexIndex(material, inputs, &bsdf);
      bsdf.color = material.constant_tint.At(wavelengths);
      break;
    case BsdfKind::kCoatedConductor:
      inputs.eta = material.conductor_eta.spectrum.At(wavelengths);
      inputs.k = material.conductor_k.spectrum.At(wavelengths);
      SetCoatedConductor(material, inputs, &bsdf);
      bsdf.color = material.constant_tint.At(wavelengths);
      break;
    case BsdfKind::kDiffuseTransmission:
      inputs.eta = material.conductor_eta.spectrum.At(wavelengths);
      SetSheet(material, inputs, &bsdf);
      break;
    default:
      bsdf.color = ClampReflectance(inputs.color);
  }
  return bsdf;
}

// Keeps NaN, as ClampReflectance does.
float Clamp(float value, float low, float high) {
  return value < low ? low : (value > high ? high : value);
}

template <typename Color>
BsdfOf<Color> MakeHair(const TextureProgram& textures, const CompiledHair& hair,
                       const TexturePoint& point, const WavelengthsOf<Color>& wavelengths) {
  constexpr float kAbsorptionMax = 1e8f;  // Effectively black; keeps products finite.
  const auto color = [&](const ColorOperand& operand) {
    return textures.Value<Color>(operand, point, wavelengths);
  };
  const auto number = [&](const FloatOperand& operand) { return textures.Float(operand, point); };
  const float beta_n = Clamp(number(hair.beta_n), kHairBetaMin, 1);
  BsdfOf<Color> bsdf;
  bsdf.kind = BsdfKind::kHair;
  bsdf.eta = Clamp(number(hair.eta), HairMaterial::kIndexMin, HairMaterial::kIndexMax);
  bsdf.alpha_x = HairVariance(Clamp(number(hair.beta_m), kHairBetaMin, 1));
  bsdf.alpha_y = HairLogisticScale(beta_n);
  const float tilt_degrees = Clamp(number(hair.alpha_degrees), -90, 90);
  bsdf.hair.sin_tilt = Sin(tilt_degrees * static_cast<float>(kPi / 180));
  bsdf.hair.offset = Clamp(2 * point.uv.y - 1, -1, 1);
  switch (hair.pigment) {
    case HairMaterial::Pigment::kAbsorption:
      bsdf.color = color(hair.color);
      break;
    case HairMaterial::Pigment::kReflectance: {
      const Color c = ClampReflectance(color(hair.color));
      bsdf.color = MakeColor<Color>([&](size_t i) { return HairAbsorption(c[i], beta_n); });
      break;
    }
    case HairMaterial::Pigment::kMelanin:
      bsdf.color = color(hair.eumelanin_absorption) * std::fmax(number(hair.eumelanin), 0.0f) +
                   color(hair.pheomelanin_absorption) * std::fmax(number(hair.pheomelanin), 0.0f);
      break;
  }
  bsdf.color = MakeColor<Color>([&](size_t i) { return Clamp(bsdf.color[i], 0, kAbsorptionMax); });
  const float scale = HairReflectanceScale(beta_n);
  bsdf.albedo = MakeColor<Color>([&](size_t i) { return Exp(-std::sqrt(bsdf.color[i]) * scale); });
  return bsdf;
}

Bsdf MakeMeasured(const MeasuredBrdf& measured, NoWavelengths) {
  Bsdf bsdf;
  bsdf.kind = BsdfKind::kMeasured;
  bsdf.measured = &measured;
  bsdf.albedo = measured.albedo();
  return bsdf;
}
BsdfOf<Spectral> MakeMeasured(const MeasuredBrdf& measured, const Wavelengths& wavelengths) {
  BsdfOf<Spectral> bsdf;
  bsdf.kind = BsdfKind::kMeasured;
  bsdf.measured = &measured;
  bsdf.conductor_eta = {wavelengths.nm};
  return bsdf;
}

void SetDispersion(const CompiledMaterial&, NoWavelengths, Bsdf*) {}
void SetDispersion(const CompiledMaterial& material, const Wavelengths& wavelengths,
                   BsdfOf<Spectral>* bsdf) {
  if (!material.disperses) return;
  bsdf->disperses = true;
  bsdf->eta = material.index.At(wavelengths.hero_nm());
}

}  // namespace

const CompiledMaterial& ChooseMaterial(const std::vector<CompiledMaterial>& materials,
                                       const TextureProgram& textures, int32_t material,
                                       const TexturePoint& point, float u) {
  const CompiledMaterial* chosen = &materials[static_cast<size_t>(material)];
  while (chosen->is_mix) {
    const float amount = std::clamp(textures.Float(chosen->amount, point), 0.0f, 1.0f);
    const bool second = u < amount;
    u = second ? u / amount : (u - amount) / (1 - amount);
    u = std::min(0x1.fffffep-1f, u);
    chosen = &materials[static_cast<size_t>(chosen->mix[second ? 1 : 0])];
  }
  return *chosen;
}

template <TraitBits kTraits>
BsdfOf<ColorOf<kTraits>> MaterialTable::Evaluate(
    int32_t material, const TexturePoint& point, float u_mix,
    const WavelengthsOf<ColorOf<kTraits>>& wavelengths) const {
  using Color = ColorOf<kTraits>;
  BsdfOf<Color> bsdf;
  if (material == kNone) {
    bsdf.kind = BsdfKind::kInterface;
    bsdf.specular = true;
    return bsdf;
  }
  const CompiledMaterial* chosen = &impl_->materials[static_cast<size_t>(material)];
  if constexpr (Has(kTraits, Trait::kAlpha)) {
    if (chosen->is_mix) {
      chosen = &ChooseMaterial(impl_->materials, *impl_->textures, material, point, u_mix);
    }
  }
  if constexpr (Has(kTraits, Trait::kHair)) {
    if (chosen->hair != nullptr) {
      return MakeHair<Color>(*impl_->textures, *chosen->hair, point, wavelengths);
    }
  }
  if constexpr (Has(kTraits, Trait::kMeasured)) {
    if (chosen->measured != nullptr) return MakeMeasured(*chosen->measured, wavelengths);
  }
  if constexpr (Has(kTraits, Trait::kPrincipled)) {
    if (chosen->principled != nullptr) {
      return MakePrincipled<Color>(*impl_->textures, *chosen->principled, point, wavelengths);
    }
  }
  if constexpr (Has(kTraits, Trait::kTextures)) {
    if (chosen->varies) {
      bsdf = MakeBsdf(*chosen, InputsAt<Color>(*impl_->textures, *chosen, point, wavelengths));
      SetDispersion(*chosen, wavelengths, &bsdf);
      return bsdf;
    }
  }
  bsdf = ConstantAt(*chosen, wavelengths);
  SetDispersion(*chosen, wavelengths, &bsdf);
  return bsdf;
}

namespace {

template <typename Color>
Color SubsurfaceAlbedoAt(const CompiledMaterial& material, const TextureProgram& textures,
                         const TexturePoint& point, const WavelengthsOf<Color>& wavelengths) {
  const Color reflectance =
      textures.Value<Color>(material.subsurface_reflectance, point, wavelengths);
  return MakeColor<Color>([&](size_t i) { return material.subsurface_albedo->At(reflectance[i]); });
}

}  // namespace

Rgb MaterialTable::SubsurfaceAlbedo(int32_t material, const TexturePoint& point,
                                    NoWavelengths wavelengths) const {
  return SubsurfaceAlbedoAt<Rgb>(impl_->materials[static_cast<size_t>(material)], *impl_->textures,
                                 point, wavelengths);
}

Spectral MaterialTable::SubsurfaceAlbedo(int32_t material, const TexturePoint& point,
                                         const Wavelengths& wavelengths) const {
  return SubsurfaceAlbedoAt<Spectral>(impl_->materials[static_cast<size_t>(material)],
                                      *impl_->textures, point, wavelengths);
}

uint64_t MaterialTable::memory_bytes() const {
  const ScatteringTables& tables = impl_->tables;
  uint64_t bytes = VectorBytes(impl_->materials) + tables.hairs.size() * sizeof(CompiledHair) +
                   tables.conductor_coats.size() * sizeof(ConductorCoatRow) +
                   tables.subsurface_albedos.size() * sizeof(AlbedoCurve);
  for (const auto& [key, rows] : tables.coats) bytes += VectorBytes(rows);
  for (const auto& [key, rows] : tables.conductors) bytes += VectorBytes(rows);
  for (const auto& [key, rows] : tables.dielectrics) bytes += VectorBytes(rows);
  for (const auto& [file, brdf] : tables.measured) bytes += sizeof brdf + brdf.memory_bytes();
  bytes += tables.principled.memory_bytes();
  return bytes;
}

uint64_t MaterialTable::texture_bytes() const { return impl_->cache->memory_bytes(); }

template <TraitBits kTraits>
float MaterialTable::EvaluateFloat(const FloatInput& input, const TexturePoint& point) const {
  if constexpr (Has(kTraits, Trait::kTextures)) {
    return impl_->textures->Float(impl_->textures->Operand(input), point);
  }
  return impl_->textures->Operand(input).value;
}

#define SHEAF_INSTANTIATE_MATERIAL(name, traits)                                                \
  template BsdfOf<ColorOf<(traits)>> MaterialTable::Evaluate<(traits)>(                         \
      int32_t, const TexturePoint&, float, const WavelengthsOf<ColorOf<(traits)>>&) const;      \
  template float MaterialTable::EvaluateFloat<(traits)>(const FloatInput&, const TexturePoint&) \
      const;
SHEAF_RENDER_VARIANTS(SHEAF_INSTANTIATE_MATERIAL)
SHEAF_ABLATED_VARIANTS(SHEAF_INSTANTIATE_MATERIAL)
#undef SHEAF_INSTANTIATE_MATERIAL

}  // namespace sheaf::render
