// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/principled_media.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/scene/pbrt/statements/color_parameters.h"

namespace sheaf {
namespace {

// The least light that remains after the distance; less counts as this, so that absorption is
// finite.
constexpr float kRemainderMin = 1e-6f;

bool Transmits(const PrincipledMaterial& material) {
  return material.transmission.texture != kNone || material.transmission.value > 0;
}

// Source: KHR_materials_volume (Beer-Lambert).
MediumDescription AbsorbingMedium(const PrincipledMaterial& material,
                                  const MaterialDescription& description) {
  MediumDescription medium;
  medium.name = description.name.empty() ? "inside of a principled material"
                                         : absl::StrCat("inside of ", description.name);
  medium.location = description.location;
  medium.kind = HomogeneousMedium{};
  Rgb sigma_a;
  for (size_t c = 0; c < 3; ++c) {
    const float left = std::clamp(material.attenuation_color.rgb[c], kRemainderMin, 1.0f);
    sigma_a[c] = -std::log(left) / material.attenuation_distance;
  }
  medium.sigma_a = RgbColor(sigma_a);
  medium.sigma_s = RgbColor({});
  return medium;
}

}  // namespace

int32_t PrincipledOf(const SceneDescription& scene, int32_t material) {
  if (material == kNone) return kNone;
  const auto& kind = scene.materials[static_cast<size_t>(material)].material;
  if (std::holds_alternative<PrincipledMaterial>(kind)) return material;
  const auto* mix = std::get_if<MixMaterial>(&kind);
  if (mix == nullptr || mix->material[1] == kNone || mix->material[0] == kNone) return kNone;
  const auto& cut = scene.materials[static_cast<size_t>(mix->material[0])].material;
  const auto& whole = scene.materials[static_cast<size_t>(mix->material[1])].material;
  const bool is_alpha = std::holds_alternative<InterfaceMaterial>(cut) &&
                        std::holds_alternative<PrincipledMaterial>(whole);
  return is_alpha ? mix->material[1] : kNone;
}

void AddPrincipledMedia(SceneDescription* scene, Diagnostics* diagnostics) {
  std::map<int32_t, int32_t> medium_of;
  for (ShapeDescription& shape : scene->shapes) {
    const int32_t index = PrincipledOf(*scene, shape.material);
    if (index == kNone || shape.media.Separates()) continue;
    const MaterialDescription& description = scene->materials[static_cast<size_t>(index)];
    const auto& material = std::get<PrincipledMaterial>(description.material);
    if (!(material.attenuation_distance > 0) || !Transmits(material)) continue;
    if (std::holds_alternative<CurveShape>(shape.shape)) {
      diagnostics->Warning(shape.location, "the attenuation has no effect: curves have no inside");
      continue;
    }
    const auto [entry, is_new] =
        medium_of.emplace(index, static_cast<int32_t>(scene->media.size()));
    if (is_new) scene->media.push_back(AbsorbingMedium(material, description));
    shape.media.inside = entry->second;
  }
}

void AddPrincipledEmission(SceneDescription* scene, Diagnostics* diagnostics) {
  std::map<int32_t, int32_t> light_of;
  const auto emits = [](const PrincipledMaterial& material) {
    return !material.emission.rgb.IsBlack() && material.emission_strength > 0;
  };
  const auto emission_of = [&](const ShapeDescription& shape) -> const PrincipledMaterial* {
    const int32_t index = PrincipledOf(*scene, shape.material);
    if (index == kNone) return nullptr;
    const auto& material =
        std::get<PrincipledMaterial>(scene->materials[static_cast<size_t>(index)].material);
    return emits(material) ? &material : nullptr;
  };
  for (const int32_t shape_index : scene->world_shapes) {
    ShapeDescription& shape = scene->shapes[static_cast<size_t>(shape_index)];
    const PrincipledMaterial* material = emission_of(shape);
    if (material == nullptr || shape.area_light != kNone) continue;
    const auto [entry, is_new] =
        light_of.emplace(shape.material, static_cast<int32_t>(scene->area_lights.size()));
    if (is_new) {
      AreaLightDescription light;
      light.radiance = material->emission;
      light.scale.scale = material->emission_strength;
      light.location = scene->materials[static_cast<size_t>(shape.material)].location;
      scene->area_lights.push_back(std::move(light));
    }
    shape.area_light = entry->second;
  }
  for (const ObjectDefinition& object : scene->objects) {
    for (const int32_t shape_index : object.shapes) {
      const ShapeDescription& shape = scene->shapes[static_cast<size_t>(shape_index)];
      if (emission_of(shape) == nullptr) continue;
      diagnostics->Warning(shape.location,
                           "shapes of an object emit no light; the emission of "
                           "the material is ignored here");
      break;
    }
  }
}

}  // namespace sheaf
