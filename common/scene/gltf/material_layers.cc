// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Materials for extensions: transmission, volume, ior, clearcoat, sheen, specular,
// iridescence, anisotropy. Ranges and defaults are those of the extensions' specifications.
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
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
  const double least = NumberOf(film, "iridescenceThicknessMinimum", 100);
  const double most = NumberOf(film, "iridescenceThicknessMaximum", 400);
  // Without a texture the thickness is the maximum.
  const bool varies = RefOf(film, "iridescenceThicknessTexture").IsSet();
  material->iridescence_thickness_nm = static_cast<float>(std::clamp(
      varies ? 0.5 * (least + most) : most, 0.0, double{PrincipledMaterial::kThicknessMaxNm}));
  if (varies) {
    Ignore(what,
           "the texture of its film's thickness has no effect; the mean of both ends is used");
  }
}

void Materials::SetLayers(const tinygltf::Material& source, const std::string& what,
                          PrincipledMaterial* material) {
  SetTransmission(source, what, material);
  SetSpecular(source, what, material);
  SetIridescence(source, what, material);
  const auto constant = [&](const tinygltf::Value* extension, const std::string& key,
                            const std::string& name) {
    if (!RefOf(extension, key).IsSet()) return;
    Ignore(what, absl::StrCat("the texture of its ", name,
                              " has no effect; the factor alone is "
                              "used"));
  };
  if (const tinygltf::Value* coat = Find(source.extensions, "KHR_materials_clearcoat")) {
    material->coat = Number(UnitOf(coat, "clearcoatFactor", 0), RefOf(coat, "clearcoatTexture"), 0,
                            what + ", clearcoat");
    material->coat_roughness = UnitOf(coat, "clearcoatRoughnessFactor", 0);
    constant(coat, "clearcoatRoughnessTexture", "clearcoat's roughness");
    constant(coat, "clearcoatNormalTexture", "clearcoat's normals");
  }
  if (const tinygltf::Value* sheen = Find(source.extensions, "KHR_materials_sheen")) {
    material->sheen_color = ColorTimes(ColorOf(sheen, "sheenColorFactor", {}),
                                       RefOf(sheen, "sheenColorTexture"), what + ", sheen");
    material->sheen_roughness = UnitOf(sheen, "sheenRoughnessFactor", 0);
    constant(sheen, "sheenRoughnessTexture", "sheen's roughness");
  }
  if (const tinygltf::Value* anisotropy = Find(source.extensions, "KHR_materials_anisotropy")) {
    material->anisotropy = UnitOf(anisotropy, "anisotropyStrength", 0);
    const double limit = PrincipledMaterial::kRotationMax;
    material->rotation_radians = static_cast<float>(
        std::clamp(NumberOf(anisotropy, "anisotropyRotation", 0), -limit, limit));
    constant(anisotropy, "anisotropyTexture", "anisotropy");
  }
}

}  // namespace sheaf::gltf
