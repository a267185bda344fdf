// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SceneBuilder that gives shapes the emission of their principled material.
#include <map>
#include <utility>
#include <variant>

#include "common/scene/pbrt/principled_media.h"
#include "common/scene/pbrt/scene_builder.h"

namespace sheaf {

void SceneBuilder::FinishPrincipledEmission() {
  std::map<int32_t, int32_t> light_of;
  const auto emits = [](const PrincipledMaterial& material) {
    return !material.emission.rgb.IsBlack() && material.emission_strength > 0;
  };
  const auto emission_of = [&](const ShapeDescription& shape) -> const PrincipledMaterial* {
    const int32_t index = PrincipledOf(*scene_, shape.material);
    if (index == kNone) return nullptr;
    const auto& material =
        std::get<PrincipledMaterial>(scene_->materials[static_cast<size_t>(index)].material);
    return emits(material) ? &material : nullptr;
  };
  for (const int32_t shape_index : scene_->world_shapes) {
    ShapeDescription& shape = scene_->shapes[static_cast<size_t>(shape_index)];
    const PrincipledMaterial* material = emission_of(shape);
    if (material == nullptr || shape.area_light != kNone) continue;
    const auto [entry, is_new] =
        light_of.emplace(shape.material, static_cast<int32_t>(scene_->area_lights.size()));
    if (is_new) {
      AreaLightDescription light;
      light.radiance = material->emission;
      light.scale.scale = material->emission_strength;
      light.location = scene_->materials[static_cast<size_t>(shape.material)].location;
      scene_->area_lights.push_back(std::move(light));
    }
    shape.area_light = entry->second;
  }
  for (const ObjectDefinition& object : scene_->objects) {
    for (const int32_t shape_index : object.shapes) {
      const ShapeDescription& shape = scene_->shapes[static_cast<size_t>(shape_index)];
      if (emission_of(shape) == nullptr) continue;
      diagnostics_->Warning(shape.location,
                            "shapes of an object emit no light; the emission of "
                            "the material is ignored here");
      break;
    }
  }
}

}  // namespace sheaf
