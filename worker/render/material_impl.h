// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What MaterialTable holds: for its own two source files only.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <tuple>
#include <vector>

#include "common/image/texture_cache.h"
#include "worker/render/material.h"
#include "worker/render/texture_program.h"

namespace sheaf::render {

// What a Bsdf is made of at one point.
struct SurfaceInputs {
  Rgb color, eta, k;
  float roughness_u = 0, roughness_v = 0;
};

struct CompiledMaterial {
  BsdfKind kind = BsdfKind::kBlack;
  bool is_mix = false;
  bool varies = false;  // Some input is a texture; else `constant` is the Bsdf.
  bool remap_roughness = true;
  bool from_reflectance = false;  // Conductors: color is the reflectance, eta and k follow.
  float eta = 1;
  ColorOperand color, eta_rgb, k_rgb;
  FloatOperand roughness_u, roughness_v;
  FloatOperand amount;  // Of the second material of a mix.
  int32_t mix[2] = {kNone, kNone};
  // One row for constant roughness, else one for each alpha node.
  const std::vector<CoatRow>* coat_rows = nullptr;
  const std::vector<ConductorEnergyRow>* conductor_rows = nullptr;
  const std::vector<DielectricEnergyRow>* dielectric_rows = nullptr;
  Bsdf constant;
};

Bsdf MakeBsdf(const CompiledMaterial& material, const SurfaceInputs& inputs);

// Tables of the scene, each made once. Key: both alphas (negative for all nodes), eta, thickness.
struct ScatteringTables {
  using Key = std::tuple<float, float, float, float>;
  std::map<Key, std::vector<CoatRow>> coats;
  std::map<Key, std::vector<ConductorEnergyRow>> conductors;
  std::map<Key, std::vector<DielectricEnergyRow>> dielectrics;
};

struct MaterialTable::Impl {
  std::unique_ptr<TextureCache> cache;
  std::optional<TextureProgram> textures;
  std::vector<CompiledMaterial> materials;  // As SceneDescription::materials.
  ScatteringTables tables;
};

}  // namespace sheaf::render
