// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The data of a MaterialTable: for its own source files only.
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
#include "worker/render/material/hair.h"
#include "worker/render/material/material.h"
#include "worker/render/material/principled.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {

// The inputs of a Bsdf at one point.
template <typename Color>
struct SurfaceInputs {
  Color color, eta, k;
  float roughness_u = 0, roughness_v = 0;
};

struct CompiledMaterial {
  BsdfKind kind = BsdfKind::kBlack;
  bool is_mix = false;
  bool varies = false;  // Some input is a texture; else `constant` is the Bsdf.
  bool remap_roughness = true;
  bool from_reflectance = false;  // Conductors: color is the reflectance and determines eta and k.
  float eta = 1;                  // For dielectrics and coats.
  float scale = 1;                // For both colors of diffuse transmission.
  bool disperses = false;         // The index varies with wavelength; replaces eta if spectral.
  SpectralColor index;
  ColorOperand color;
  ColorOperand conductor_eta;  // Diffuse transmission: the transmittance.
  ColorOperand conductor_k;
  FloatOperand roughness_u, roughness_v;
  FloatOperand amount;  // Weight of the second material of a mix.
  int32_t mix[2] = {kNone, kNone};
  // One row for constant roughness, else one for each alpha node.
  const std::vector<CoatRow>* coat_rows = nullptr;
  const std::vector<ConductorEnergyRow>* conductor_rows = nullptr;
  const std::vector<DielectricEnergyRow>* dielectric_rows = nullptr;
  const ConductorCoatRow* conductor_coat = nullptr;
  // For subsurface materials with textured reflectance.
  ColorOperand subsurface_reflectance;
  const AlbedoCurve* subsurface_albedo = nullptr;
  const CompiledHair* hair = nullptr;              // For hair, which uses no other member.
  const MeasuredBrdf* measured = nullptr;          // Likewise.
  const CompiledPrincipled* principled = nullptr;  // Likewise.
  // Normal or bump map: at most one of the two.
  int32_t normal_map = kNone;  // Texture.
  float normal_scale = 1;
  std::optional<CoatNormals> coat_normals;
  FloatOperand displacement;
  TextureProgram::SlopeScale slope_scale;
  Bsdf constant;
  // BsdfOf::color of `constant` per wavelength, if it is a rough or coated conductor.
  SpectralColor constant_tint;
};

// Returns k of a conductor with index 1 and `reflectance` at normal incidence.
inline float AbsorptionOf(float reflectance) {
  if (reflectance >= 1) return kPerfectConductorK;
  return 2 * std::sqrt(reflectance / (1 - reflectance));
}

// Returns an index or absorption relative to a coat instead of vacuum; a perfect conductor stays
// perfect.
inline float AgainstCoat(float index, float coat_eta) {
  return index >= kPerfectConductorK ? index : index / coat_eta;
}

// Follows mixes down to a material; rescales u, which stays uniform.
const CompiledMaterial& ChooseMaterial(const std::vector<CompiledMaterial>& materials,
                                       const TextureProgram& textures, int32_t material,
                                       const TexturePoint& point, float u);

template <typename Color>
BsdfOf<Color> MakeBsdf(const CompiledMaterial& material, const SurfaceInputs<Color>& inputs);

// Tables of the scene, shared by equal materials. Key: both alphas (negative for all nodes), eta,
// thickness.
struct ScatteringTables {
  using Key = std::tuple<float, float, float, float>;
  std::map<Key, std::vector<CoatRow>> coats;
  std::map<Key, std::vector<ConductorEnergyRow>> conductors;
  std::map<Key, std::vector<DielectricEnergyRow>> dielectrics;
  // Key: the interface's alphas, the base's, eta, thickness.
  std::map<std::array<float, 6>, ConductorCoatRow> conductor_coats;
  std::map<std::pair<float, float>, AlbedoCurve> subsurface_albedos;  // By index and asymmetry.
  std::deque<CompiledHair> hairs;
  std::map<std::string, MeasuredBrdf> measured;  // By file.
  PrincipledTables principled;
};

struct MaterialTable::Impl {
  std::unique_ptr<TextureCache> cache;
  std::optional<TextureProgram> textures;
  std::vector<CompiledMaterial> materials;  // As SceneDescription::materials.
  ScatteringTables tables;
};

}  // namespace sheaf::render
