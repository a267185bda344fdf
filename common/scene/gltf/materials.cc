// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/materials.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

float Unit(double x) {
  return static_cast<float>(std::isfinite(x) ? std::clamp(x, 0.0, 1.0) : 1.0);
}

// KHR_materials_pbrSpecularGlossiness replaces the base of the core format.
const tinygltf::Value* GlossOf(const tinygltf::Material& source) {
  return Find(source.extensions, "KHR_materials_pbrSpecularGlossiness");
}

std::vector<double> BaseFactor(const tinygltf::Material& source) {
  const tinygltf::Value* gloss = GlossOf(source);
  if (gloss != nullptr) return NumbersOf(gloss, "diffuseFactor", 4, {1, 1, 1, 1});
  return source.pbrMetallicRoughness.baseColorFactor;
}

float AlphaFactor(const tinygltf::Material& source) {
  const std::vector<double> factor = BaseFactor(source);
  return factor.size() == 4 ? Unit(factor[3]) : 1;
}

TextureRef BaseColorTexture(const tinygltf::Material& source) {
  const tinygltf::Value* gloss = GlossOf(source);
  if (gloss != nullptr) return RefOf(gloss, "diffuseTexture");
  const tinygltf::TextureInfo& info = source.pbrMetallicRoughness.baseColorTexture;
  return RefOf(info.index, info.texCoord, info.extensions);
}

Rgb BaseColorFactor(const tinygltf::Material& source) {
  return ColorOfNumbers(BaseFactor(source), Rgb::Gray(1));
}

}  // namespace

int Materials::FirstSetOf(const tinygltf::Material& source) {
  const tinygltf::NormalTextureInfo& normals = source.normalTexture;
  const TextureRef normal = RefOf(normals.index, normals.texCoord, normals.extensions);
  if (normal.IsSet()) return normal.uv_set;
  const TextureRef coat_normal =
      RefOf(Find(source.extensions, "KHR_materials_clearcoat"), "clearcoatNormalTexture");
  if (coat_normal.IsSet()) return coat_normal.uv_set;
  if (source.extensions.contains("KHR_materials_unlit")) {
    const TextureRef unlit = BaseColorTexture(source);
    return unlit.IsSet() ? unlit.uv_set : -1;
  }
  const tinygltf::TextureInfo& emission = source.emissiveTexture;
  const TextureRef light = RefOf(emission.index, emission.texCoord, emission.extensions);
  const bool emits = !ColorOfNumbers(source.emissiveFactor, {}).IsBlack();
  return emits && light.IsSet() ? light.uv_set : -1;
}

bool Materials::Uses(const std::string& what, bool may_be_second, TextureRef* ref) {
  if (!ref->IsSet()) return false;
  if (uv_set_ < 0) uv_set_ = ref->uv_set;
  if (uv_set_ == ref->uv_set) return true;
  const bool is_free = second_uv_set_ < 0 || second_uv_set_ == ref->uv_set;
  if (may_be_second && is_free && !has_colors_) {
    second_uv_set_ = ref->uv_set;
    ref->mapping.kind = UvMapping::Kind::kSecondUv;
    return true;
  }
  Ignore(what, absl::StrCat("uses TEXCOORD_", ref->uv_set, " beside TEXCOORD_", uv_set_,
                            has_colors_ ? " and colors of vertices" : "",
                            ", and is left out; bake it for those"));
  return false;
}

FloatInput Materials::Number(float factor, TextureRef ref, int channel, const std::string& what) {
  FloatInput input{.value = factor};
  if (factor > 0 && Uses(what, true, &ref)) {
    input.texture = textures_->Channel(ref, channel, factor, std::nullopt, what);
  }
  return input;
}

ColorInput Materials::ColorTimes(Rgb factor, TextureRef ref, const std::string& what) {
  ColorInput input{.value = Color(factor)};
  if (!factor.IsBlack() && Uses(what, true, &ref)) {
    input.texture = textures_->Color(ref, factor, what);
  }
  return input;
}

void Materials::TimesVertexColor(const std::string& what, ColorInput* input) {
  if (has_colors_) {
    input->texture = AddTexture(what + ", vertices", VertexColorTexture{.color = *input}, true);
  }
}

void Materials::TimesVertexAlpha(const std::string& what, FloatInput* input) {
  if (has_colors_) {
    input->texture = AddTexture(what + ", vertices", VertexColorTexture{.value = *input}, false);
  }
}

void Materials::SetBase(const tinygltf::Material& source, const std::string& what,
                        PrincipledMaterial* material) {
  const tinygltf::PbrMetallicRoughness& base = source.pbrMetallicRoughness;
  material->base_color =
      ColorTimes(BaseColorFactor(source), BaseColorTexture(source), what + ", base color");
  TimesVertexColor(what + ", base color", &material->base_color);
  if (GlossOf(source) == nullptr) {
    const tinygltf::TextureInfo& info = base.metallicRoughnessTexture;
    const TextureRef both = RefOf(info.index, info.texCoord, info.extensions);
    material->metallic = Number(Unit(base.metallicFactor), both, 2, what + ", metallic");
    material->roughness = Number(Unit(base.roughnessFactor), both, 1, what + ", roughness");
  }
  if (source.occlusionTexture.index >= 0) {
    Ignore(what, "its occlusion has no effect: paths find what is occluded");
  }
}

void Materials::SetOpacity(const tinygltf::Material& source, const std::string& what,
                           Surface* surface) {
  if (source.alphaMode != "MASK" && source.alphaMode != "BLEND") return;
  const float factor = AlphaFactor(source);
  TextureRef texture = BaseColorTexture(source);
  const bool is_mask = source.alphaMode == "MASK";
  const auto cutoff =
      static_cast<float>(std::isfinite(source.alphaCutoff) ? source.alphaCutoff : 0.5);
  surface->has_alpha = true;
  surface->alpha.value = is_mask ? (factor >= cutoff ? 1.0f : 0.0f) : factor;
  const bool emits = surface->area_light != kNone || surface->light_of_colors.has_value();
  if (Uses(what + ", opacity", !emits, &texture)) {
    surface->alpha.texture = textures_->Channel(
        texture, 3, factor, is_mask ? std::optional<float>(cutoff) : std::nullopt,
        what + ", opacity");
  }
  if (!is_mask) {
    TimesVertexAlpha(what + ", opacity", &surface->alpha);
  } else if (has_colors_) {
    Ignore(what, "alpha of vertices has no effect on a mask; use alphaMode BLEND");
  }
}

void Materials::AddLight(Rgb radiance, TextureRef texture, const std::string& what,
                         const tinygltf::Material& source, Surface* surface) {
  if (radiance.IsBlack()) return;
  AreaLightDescription light;
  light.location = kFile;
  light.two_sided = source.doubleSided;
  light.radiance = Color(radiance);
  if (Uses(what, false, &texture)) {
    if (!textures_->SetEmission(texture, what, &light)) return;
    light.radiance = Color(Rgb::Gray(1));
    // A gray factor is a scale, so that lights of one image share it.
    const bool is_gray = radiance.r == radiance.g && radiance.g == radiance.b;
    if (is_gray) {
      light.scale.scale = radiance.r;
    } else {
      light.tint = radiance;
      light.radiance = Color(radiance);  // The value without the image.
    }
  }
  surface->area_light = static_cast<int32_t>(scene_->area_lights.size());
  scene_->area_lights.push_back(std::move(light));
}

void Materials::SetEmission(const tinygltf::Material& source, const std::string& what,
                            Surface* surface) {
  const double strength =
      NumberOf(Find(source.extensions, "KHR_materials_emissive_strength"), "emissiveStrength", 1);
  const Rgb factor = ColorOfNumbers(source.emissiveFactor, {});
  const tinygltf::TextureInfo& info = source.emissiveTexture;
  AddLight(factor * static_cast<float>(std::clamp(strength, 0.0, 1e9)),
           RefOf(info.index, info.texCoord, info.extensions), what + ", emission", source, surface);
}

void Materials::SetUnlit(const tinygltf::Material& source, const std::string& what,
                         Surface* surface, PrincipledMaterial* material) {
  Ignore(what, "is unlit (KHR_materials_unlit): it emits its color, and so lights other things");
  const bool emits_colors = has_colors_ && !BaseColorTexture(source).IsSet();
  if (has_colors_ && !emits_colors) {
    Ignore(what, "colors of vertices (COLOR_0) have no effect on the texture that it emits");
  }
  material->base_color.value = Color({});
  material->metallic.value = 0;
  material->roughness.value = 1;
  material->specular.value = 0;
  AddLight(BaseColorFactor(source), BaseColorTexture(source), what + ", unlit color", source,
           surface);
  if (!emits_colors || surface->area_light == kNone) return;
  // Each primitive has a light of its own, with an image of its colors.
  surface->light_of_colors = std::move(scene_->area_lights.back());
  surface->light_of_colors->tint = BaseColorFactor(source);
  scene_->area_lights.pop_back();
  surface->area_light = kNone;
}

Surface Materials::Make(const tinygltf::Material& source, const std::string& what) {
  uv_set_ = FirstSetOf(source);
  second_uv_set_ = -1;
  Surface surface;
  MaterialDescription description;
  description.name = source.name;
  description.location = kFile;
  PrincipledMaterial material;
  material.specular_tint.value = Color(Rgb::Gray(1));
  material.attenuation_color = Color(Rgb::Gray(1));
  const bool is_unlit = source.extensions.contains("KHR_materials_unlit");
  if (is_unlit) {
    SetUnlit(source, what, &surface, &material);
  } else {
    SetBase(source, what, &material);
    SetLayers(source, what, &material);
    SetSpecularGlossiness(source, what, &material);
    SetEmission(source, what, &surface);
    const tinygltf::NormalTextureInfo& info = source.normalTexture;
    TextureRef normals = RefOf(info.index, info.texCoord, info.extensions);
    if (Uses(what + ", normal map", false, &normals)) {
      description.normal_map = textures_->NormalMap(normals, what + ", normal map");
      if (std::isfinite(info.scale)) description.normal_scale = static_cast<float>(info.scale);
    }
    SetCoatNormals(source, what, &description);
  }
  SetOpacity(source, what, &surface);
  surface.uv_sets = {std::max(uv_set_, 0), second_uv_set_};
  NoteDispersion(source, what, &material);
  surface.material = static_cast<int32_t>(scene_->materials.size());
  description.material = std::move(material);
  scene_->materials.push_back(std::move(description));
  return surface;
}

const Surface& Materials::Get(int index, bool has_colors) {
  const auto found = known_.find({index, has_colors});
  if (found != known_.end()) return found->second;
  if (index >= 0 && !HasIndex(model_->materials, index)) {
    diagnostics_->Error(kFile, absl::StrCat("material ", index,
                                            " does not exist; export the file "
                                            "again"));
    index = -1;
    if (const auto known = known_.find({index, has_colors}); known != known_.end())
      return known->second;
  }
  const tinygltf::Material fallback;
  const tinygltf::Material& source =
      index < 0 ? fallback : model_->materials[static_cast<size_t>(index)];
  has_colors_ = has_colors;
  return known_
      .emplace(
          std::pair(index, has_colors),
          Make(source, index < 0 ? "the default material" : Named("material", index, source.name)))
      .first->second;
}

}  // namespace sheaf::gltf
