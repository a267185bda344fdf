// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialDescription: a material as a scene file says it, as plain structs. Part of
// SceneDescription.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "common/scene/color_spec.h"

namespace sheaf {

// A number or color that is constant, or multiplied in from a texture.
struct FloatInput {
  float value = 0;
  int32_t texture = kNone;  // Index in textures; then `value` is unused.
};
struct ColorInput {
  ColorSpec value;
  int32_t texture = kNone;
};

// Roughness as written; alpha = sqrt(roughness) where remap_roughness (pbrt-v4's rule), else
// itself.
struct RoughnessInput {
  FloatInput u, v;
  bool remap_roughness = true;
};
inline constexpr float kDefaultReflectance = 0.5f;

// A described material is one that its type in scene files and its inputs say all of: it is read,
// planned and compiled without code of its own. ForEachInput calls the visitor for each input:
//   Reflectance(name, ColorInput, fallback)
//   Roughness(RoughnessInput), of the usual names
// Such a material has at most one of each, and its lobe (worker/render/bsdf/lobe.h) no tables.
template <typename Material>
concept DescribedMaterial = requires {
  Material::kType;
};

struct DiffuseMaterial {
  ColorInput reflectance;

  static constexpr const char* kType = "diffuse";
  template <typename Material, typename Visitor>
  static void ForEachInput(Material& material, Visitor& visitor) {
    visitor.Reflectance("reflectance", material.reflectance, kDefaultReflectance);
  }
};
// Lambertian on both sides: what comes in on one is reflected there or leaves on the other, scaled
// by `scale` and clamped to [0, 1].
struct DiffuseTransmissionMaterial {
  ColorInput reflectance, transmittance;
  float scale = 1;
};
struct ConductorMaterial {
  RoughnessInput roughness;
  bool has_reflectance = false;  // Then eta and k follow from reflectance; else from eta and k.
  ColorInput reflectance, eta, k;
};
// Relative index of refraction. mean is what RGB transport uses; spectrum is kRgb, and unused,
// where the index is the same at every wavelength. Its ends hold beyond them.
struct RefractiveIndex {
  float mean = 1.5f;
  ColorSpec spectrum;
  bool Disperses() const { return spectrum.kind != ColorSpec::Kind::kRgb; }
  // Matter of the same index on both sides neither bends nor reflects.
  bool IsMatched() const { return mean == 1 && !Disperses(); }
};
struct DielectricMaterial {
  RoughnessInput roughness;
  RefractiveIndex eta;
};
// The boundary of matter that scatters light beneath it.
struct SubsurfaceMaterial {
  RoughnessInput roughness;
  RefractiveIndex eta{1.33f, {}};
  int32_t medium = kNone;  // The matter: index in media, which has is_subsurface.
};
struct ThinDielectricMaterial {
  RefractiveIndex eta;
};
// A layer of index eta on top of a base.
struct ClearCoat {
  float eta = 1.5f;
  float thickness = 0.01f;  // In mean free paths of a purely absorbing coat, as in pbrt-v4.
  ColorInput albedo;        // Albedo of the coat's medium; non-zero is not supported yet.
  float g = 0;
};
struct CoatedDiffuseMaterial : ClearCoat {
  RoughnessInput roughness;
  ColorInput reflectance;
};
struct CoatedConductorMaterial : ClearCoat {
  RoughnessInput roughness;  // Roughness of the coat's interface. Neither roughness is a texture.
  ConductorMaterial conductor;  // Its index is against vacuum, as measured ones are.
};
// A fibre along dp/du; v goes across it, from one edge as seen to the other.
struct HairMaterial {
  enum class Pigment { kAbsorption, kReflectance, kMelanin };
  Pigment pigment = Pigment::kMelanin;
  ColorInput color;  // Absorption per radius of the fibre, or what a head of hair reflects.
  FloatInput eumelanin{.value = 1.3f}, pheomelanin{.value = 0};  // Concentrations.
  FloatInput eta{.value = 1.55f};
  FloatInput beta_m{.value = 0.3f}, beta_n{.value = 0.3f};  // Roughness along and around, [0, 1].
  FloatInput alpha_degrees{.value = 2};                     // Tilt of the scales, [-90, 90].

  // The range of constants.
  static constexpr float kIndexMin = 0.1f, kIndexMax = 10, kConcentrationMax = 1e6f;
};
struct MeasuredMaterial {
  std::string file;             // Canonical name for FileSource of an RGL file (.bsdf).
  bool is_anisotropic = false;  // It was measured in more than one direction around the normal.
};
// Metal, plastic and glass in one, as glTF's metallic-roughness material with its extensions and
// Blender's Principled BSDF mean it (principled_lobe.h says how it scatters).
struct PrincipledMaterial {
  ColorInput base_color;                  // Diffuse, of metal, and of what crosses.
  ColorInput specular_tint, sheen_color;  // Tint of a dielectric's reflection at normal incidence.
  FloatInput metallic, roughness{.value = 0.5f};  // alpha = roughness^2.
  FloatInput specular{.value = 1};                // Scales a dielectric's reflection.
  FloatInput transmission, coat, iridescence;
  FloatInput anisotropy, rotation_radians;  // The rougher direction, from dp/du towards dp/dv.
  // Index in textures: red and green, from [0, 1] to [-1, 1], are the direction along dp/du and
  // dp/dv to which the rotation is added. kNone: dp/du.
  int32_t anisotropy_direction = kNone;
  FloatInput coat_roughness, sheen_roughness{.value = 0.3f};
  FloatInput iridescence_thickness_nm{.value = 400};
  // Opacity. Less than 1 becomes a mix with an interface when the file is read.
  FloatInput alpha{.value = 1};
  float ior = 1.5f;
  bool thin = false;  // A sheet: what crosses is not refracted, and there is no inside.
  float coat_ior = 1.5f, iridescence_ior = 1.3f;
  // The range of a texture of the film's thickness; beyond it the nearer end counts.
  float film_least_nm = 0, film_most_nm = 1000;
  // Light that remains inside after the distance, in scene units; 0: nothing is absorbed.
  ColorSpec attenuation_color;
  float attenuation_distance = 0;
  ColorSpec emission;  // Radiance, for shapes without an area light of their own.
  float emission_strength = 1;

  static constexpr float kIndexMin = 1, kIndexMax = 10, kThicknessMaxNm = 10000;
  static constexpr float kRotationMax = 1000;
  // visitor(name, input, least, greatest) for each number with its range; only a FloatInput may be
  // a texture.
  template <typename Material, typename Visitor>
  static void ForEachNumber(Material& m, const Visitor& visitor) {
    visitor("metallic", m.metallic, 0, 1);
    visitor("roughness", m.roughness, 0, 1);
    visitor("specular", m.specular, 0, 1);
    visitor("transmission", m.transmission, 0, 1);
    visitor("coat", m.coat, 0, 1);
    visitor("iridescence", m.iridescence, 0, 1);
    visitor("alpha", m.alpha, 0, 1);
    visitor("anisotropy", m.anisotropy, 0, 1);
    visitor("anisotropy_rotation", m.rotation_radians, -kRotationMax, kRotationMax);
    visitor("ior", m.ior, kIndexMin, kIndexMax);
    visitor("coat_roughness", m.coat_roughness, 0, 1);
    visitor("coat_ior", m.coat_ior, kIndexMin, kIndexMax);
    visitor("sheen_roughness", m.sheen_roughness, 0, 1);
    visitor("iridescence_ior", m.iridescence_ior, kIndexMin, kIndexMax);
    visitor("iridescence_thickness_nm", m.iridescence_thickness_nm, 0, kThicknessMaxNm);
  }
};
struct MixMaterial {
  int32_t material[2] = {kNone, kNone};
  FloatInput amount;
};
struct InterfaceMaterial {};  // Invisible; bounds a medium.

// The normals of a principled material's coat, where they are not those of what it covers.
struct CoatNormals {
  int32_t map = kNone;  // As MaterialDescription::normal_map; kNone: the shape's own normals.
  float scale = 1;
};

struct MaterialDescription {
  std::string name;  // Empty for unnamed ones.
  std::variant<DiffuseMaterial, DiffuseTransmissionMaterial, ConductorMaterial, DielectricMaterial,
               ThinDielectricMaterial, CoatedDiffuseMaterial, CoatedConductorMaterial, HairMaterial,
               MeasuredMaterial, MixMaterial, InterfaceMaterial, SubsurfaceMaterial,
               PrincipledMaterial>
      material;
  SourceLocation location;
  int32_t normal_map = kNone;  // Index in textures: red, green, blue from [0, 1] to [-1, 1].
  float normal_scale = 1;      // Multiplies the red and green of the normal map.
  std::optional<CoatNormals> coat_normals = std::nullopt;
  // A bump map's height, in scene units; unused with normal_map.
  FloatInput displacement{0, kNone};
  // Which matter is there where closed shapes overlap: that of the highest. Materials without one
  // take no part. Only dielectrics, interfaces and subsurface matter have one.
  std::optional<int32_t> priority = std::nullopt;
  // The first unnamed material that is written alike, as where a file is included twice: index in
  // materials, of this one if there is none before; kNone for named ones.
  int32_t first_alike = kNone;
};

}  // namespace sheaf
