// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What MaterialTable holds: for its own source files only.
#pragma once

#include <array>
#include <cmath>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "common/image/texture_cache.h"
#include "common/scene/half_space.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/measured_brdf.h"
#include "worker/render/material/material.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {

// What a Bsdf is made of at one point.
template <typename Color>
struct SurfaceInputs {
  Color color, eta, k;
  float roughness_u = 0, roughness_v = 0;
};

// What hair is made of, wherever it is hit.
struct CompiledHair {
  HairMaterial::Pigment pigment{};
  ColorOperand color;  // Absorption or reflectance; of melanins none.
  FloatOperand eumelanin, pheomelanin, eta, beta_m, beta_n, alpha_degrees;
  // Absorption of each melanin at concentration 1.
  ColorOperand eumelanin_absorption, pheomelanin_absorption;
};

struct CompiledMaterial {
  BsdfKind kind = BsdfKind::kBlack;
  bool is_mix = false;
  bool varies = false;  // Some input is a texture; else `constant` is the Bsdf.
  bool remap_roughness = true;
  bool from_reflectance = false;  // Conductors: color is the reflectance, eta and k follow.
  float eta = 1;                  // Of dielectrics and coats.
  float scale = 1;                // Of both colours of diffuse transmission.
  bool disperses = false;         // Index by wavelength, instead of eta in spectral transport.
  SpectralColor index;
  ColorOperand color;
  ColorOperand conductor_eta;  // Diffuse transmission: what crosses.
  ColorOperand conductor_k;
  FloatOperand roughness_u, roughness_v;
  FloatOperand amount;  // Of the second material of a mix.
  int32_t mix[2] = {kNone, kNone};
  // One row for constant roughness, else one for each alpha node.
  const std::vector<CoatRow>* coat_rows = nullptr;
  const std::vector<ConductorEnergyRow>* conductor_rows = nullptr;
  const std::vector<DielectricEnergyRow>* dielectric_rows = nullptr;
  const ConductorCoatRow* conductor_coat = nullptr;
  // For subsurface materials whose matter is painted.
  ColorOperand matter_reflectance;
  const AlbedoCurve* matter_albedo = nullptr;
  const CompiledHair* hair = nullptr;      // Of hair, which has nothing else.
  const MeasuredBrdf* measured = nullptr;  // Likewise.
  // Of maps that turn the normal: at most one of the two.
  int32_t normal_map = kNone;  // Texture.
  FloatOperand displacement;
  Vec2f displacement_step;  // In uv, half of what its slope is taken over.
  Bsdf constant;
  // Of `constant` at every wavelength, where it is a rough or coated conductor: BsdfOf::color.
  SpectralColor constant_tint;
};

// The absorption of a conductor of index 1 that reflects `reflectance` at normal incidence.
inline float AbsorptionOf(float reflectance) {
  if (reflectance >= 1) return kPerfectConductorK;
  return 2 * std::sqrt(reflectance / (1 - reflectance));
}

// An index or absorption against a coat instead of vacuum; a perfect conductor's stays one.
inline float AgainstCoat(float index, float coat_eta) {
  return index >= kPerfectConductorK ? index : index / coat_eta;
}

// Follows mixes down to a material, spending u without losing its uniformity.
const CompiledMaterial& ChooseMaterial(const std::vector<CompiledMaterial>& materials,
                                       const TextureProgram& textures, int32_t material,
                                       const TexturePoint& point, float u);

template <typename Color>
BsdfOf<Color> MakeBsdf(const CompiledMaterial& material, const SurfaceInputs<Color>& inputs);

// Tables of the scene, each made once. Key: both alphas (negative for all nodes), eta, thickness.
struct ScatteringTables {
  using Key = std::tuple<float, float, float, float>;
  std::map<Key, std::vector<CoatRow>> coats;
  std::map<Key, std::vector<ConductorEnergyRow>> conductors;
  std::map<Key, std::vector<DielectricEnergyRow>> dielectrics;
  // Key: the interface's alphas, the base's, eta, thickness.
  std::map<std::array<float, 6>, ConductorCoatRow> conductor_coats;
  std::map<std::pair<float, float>, AlbedoCurve> matter_albedos;  // By index and asymmetry.
  std::deque<CompiledHair> hairs;
  std::map<std::string, MeasuredBrdf> measured;  // By file.
};

struct MaterialTable::Impl {
  std::unique_ptr<TextureCache> cache;
  std::optional<TextureProgram> textures;
  std::vector<CompiledMaterial> materials;  // As SceneDescription::materials.
  ScatteringTables tables;
};

}  // namespace sheaf::render
