// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Materials for extensions: transmission, volume, ior, clearcoat, sheen, specular,
// iridescence, anisotropy. Ranges and defaults are those of the extensions' specifications.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "common/scene/gltf/materials.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

float UnitOf(const tinygltf::Value* object, const std::string& key, double fallback) {
  return static_cast<float>(std::clamp(NumberOf(object, key, fallback), 0.0, 1.0));
}

// The index of refraction that the format allows: 1 and above, or 0 for one without end.
float IndexOfRefraction(const tinygltf::Value* object, const std::string& key, double fallback) {
  const double ior = NumberOf(object, key, fallback);
  const double least = PrincipledMaterial::kIndexMin, most = PrincipledMaterial::kIndexMax;
  return static_cast<float>(ior == 0 ? most : std::clamp(ior, least, most));
}

bool IsSame(const TextureRef& a, const TextureRef& b) {
  const auto numbers = [](const UvMapping& m) {
    return std::array{m.scale_u, m.scale_v, m.offset_u, m.offset_v, m.turn_u, m.turn_v};
  };
  return a.index == b.index && a.uv_set == b.uv_set && numbers(a.mapping) == numbers(b.mapping);
}

}  // namespace

void Materials::SetTransmission(const tinygltf::Material& source, const std::string& what,
                                PrincipledMaterial* material) {
  const tinygltf::Value* transmission = Find(source.extensions, "KHR_materials_transmission");
  const tinygltf::Value* volume = Find(source.extensions, "KHR_materials_volume");
  material->transmission =
      Number(UnitOf(transmission, "transmissionFactor", 0),
             RefOf(transmission, "transmissionTexture"), 0, what + ", transmission");
  const bool has_inside = volume != nullptr && NumberOf(volume, "thicknessFactor", 0) > 0;
  // Without a volume the surface is infinitely thin (KHR_materials_transmission).
  material->thin = transmission != nullptr && !has_inside;
  if (!has_inside) return;
  if (RefOf(volume, "thicknessTexture").IsSet()) {
    Ignore(what, "its thickness texture has no effect: the mesh itself says how thick it is");
  }
  const double distance = NumberOf(volume, "attenuationDistance", 0);
  material->attenuation_distance = static_cast<float>(std::clamp(distance, 0.0, 1e30));
  material->attenuation_color = Color(ColorOf(volume, "attenuationColor", Rgb::Gray(1)));
}

void Materials::SetSpecular(const tinygltf::Material& source, const std::string& what,
                            PrincipledMaterial* material) {
  const tinygltf::Value* ior = Find(source.extensions, "KHR_materials_ior");
  material->ior = IndexOfRefraction(ior, "ior", 1.5);
  const tinygltf::Value* specular = Find(source.extensions, "KHR_materials_specular");
  if (specular == nullptr) return;
  material->specular = Number(UnitOf(specular, "specularFactor", 1),
                              RefOf(specular, "specularTexture"), 3, what + ", specular");
  material->specular_tint =
      ColorTimes(ColorOf(specular, "specularColorFactor", Rgb::Gray(1)),
                 RefOf(specular, "specularColorTexture"), what + ", specular color");
}

void Materials::SetIridescence(const tinygltf::Material& source, const std::string& what,
                               PrincipledMaterial* material) {
  const tinygltf::Value* film = Find(source.extensions, "KHR_materials_iridescence");
  if (film == nullptr) return;
  material->iridescence = Number(UnitOf(film, "iridescenceFactor", 0),
                                 RefOf(film, "iridescenceTexture"), 0, what + ", iridescence");
  material->iridescence_ior = IndexOfRefraction(film, "iridescenceIor", 1.3);
  const auto thickness = [&](const std::string& key, double fallback) {
    return static_cast<float>(std::clamp(NumberOf(film, key, fallback), 0.0,
                                         double{PrincipledMaterial::kThicknessMaxNm}));
  };
  const float least = thickness("iridescenceThicknessMinimum", 100);
  const float most = thickness("iridescenceThicknessMaximum", 400);
  // Without a texture the thickness is the maximum.
  material->iridescence_thickness_nm.value = most;
  if (material->iridescence.texture == kNone && material->iridescence.value == 0) return;
  const std::string name = what + ", thickness of its film";
  const FloatInput share = Number(1, RefOf(film, "iridescenceThicknessTexture"), 1, name);
  if (share.texture == kNone || least == most) return;
  MixTexture mix;
  mix.value[0].value = least;
  mix.value[1].value = most;
  mix.amount = share;
  material->iridescence_thickness_nm.texture = AddTexture(name + " in nm", std::move(mix), false);
  material->film_least_nm = std::min(least, most);
  material->film_most_nm = std::max(least, most);
}

void Materials::SetCoat(const tinygltf::Material& source, const std::string& what,
                        PrincipledMaterial* material) {
  const tinygltf::Value* coat = Find(source.extensions, "KHR_materials_clearcoat");
  if (coat == nullptr) return;
  material->coat = Number(UnitOf(coat, "clearcoatFactor", 0), RefOf(coat, "clearcoatTexture"), 0,
                          what + ", clearcoat");
  if (material->coat.texture == kNone && material->coat.value == 0) return;
  material->coat_roughness =
      Number(UnitOf(coat, "clearcoatRoughnessFactor", 0), RefOf(coat, "clearcoatRoughnessTexture"),
             1, what + ", clearcoat roughness");
}

void Materials::SetCoatNormals(const tinygltf::Material& source, const std::string& what,
                               MaterialDescription* description) {
  const tinygltf::Value* coat = Find(source.extensions, "KHR_materials_clearcoat");
  if (NumberOf(coat, "clearcoatFactor", 0) == 0) return;
  TextureRef normals = RefOf(coat, "clearcoatNormalTexture");
  if (!normals.IsSet()) {
    // The normal map is that of the base alone.
    if (description->normal_map != kNone) description->coat_normals = CoatNormals{};
    return;
  }
  const double scale = NumberOf(Member(coat, "clearcoatNormalTexture"), "scale", 1);
  const tinygltf::NormalTextureInfo& base = source.normalTexture;
  const TextureRef base_normals = RefOf(base.index, base.texCoord, base.extensions);
  if (description->normal_map != kNone && IsSame(normals, base_normals) && scale == base.scale) {
    return;
  }
  const std::string name = what + ", normal map of its clearcoat";
  if (!Uses(name, false, &normals)) return;
  const int32_t map = textures_->NormalMap(normals, name);
  if (map != kNone) description->coat_normals = CoatNormals{map, static_cast<float>(scale)};
}

void Materials::SetAnisotropy(const tinygltf::Material& source, const std::string& what,
                              PrincipledMaterial* material) {
  const tinygltf::Value* anisotropy = Find(source.extensions, "KHR_materials_anisotropy");
  if (anisotropy == nullptr) return;
  TextureRef texture = RefOf(anisotropy, "anisotropyTexture");
  const std::string name = what + ", anisotropy";
  material->anisotropy = Number(UnitOf(anisotropy, "anisotropyStrength", 0), texture, 2, name);
  const double limit = PrincipledMaterial::kRotationMax;
  material->rotation_radians.value =
      static_cast<float>(std::clamp(NumberOf(anisotropy, "anisotropyRotation", 0), -limit, limit));
  if (material->anisotropy.texture == kNone || !Uses(name, true, &texture)) return;
  material->anisotropy_direction = textures_->NormalMap(texture, name + ", direction");
}

void Materials::SetLayers(const tinygltf::Material& source, const std::string& what,
                          PrincipledMaterial* material) {
  SetTransmission(source, what, material);
  SetSpecular(source, what, material);
  SetIridescence(source, what, material);
  SetCoat(source, what, material);
  SetAnisotropy(source, what, material);
  const tinygltf::Value* sheen = Find(source.extensions, "KHR_materials_sheen");
  if (sheen == nullptr) return;
  material->sheen_color = ColorTimes(ColorOf(sheen, "sheenColorFactor", {}),
                                     RefOf(sheen, "sheenColorTexture"), what + ", sheen");
  material->sheen_roughness =
      Number(UnitOf(sheen, "sheenRoughnessFactor", 0), RefOf(sheen, "sheenRoughnessTexture"), 3,
             what + ", sheen roughness");
}

}  // namespace sheaf::gltf
