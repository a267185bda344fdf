// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/black_image.h"

#include <algorithm>
#include <variant>

#include "absl/strings/str_cat.h"

namespace sheaf {
namespace {

bool IsSky(const LightDescription& light) {
  return std::holds_alternative<InfiniteLight>(light.light);
}

bool Emits(const MediumDescription& medium) {
  return !medium.is_subsurface && medium.emits && medium.radiance_scale > 0;
}

// Shapes of objects do not emit.
bool HasEmissiveShapes(const SceneDescription& scene) {
  return std::ranges::any_of(scene.world_shapes, [&](int32_t shape) {
    return scene.shapes[static_cast<size_t>(shape)].area_light != kNone;
  });
}

}  // namespace

std::string WhyBlack(const SceneDescription& scene, SceneFormat format) {
  const std::string place = scene.files.empty() ? "" : absl::StrCat(scene.files.front(), ": ");
  const bool is_empty =
      scene.world_shapes.empty() && scene.instances.empty() && scene.camera.medium == kNone;
  const bool has_light =
      !scene.lights.empty() || HasEmissiveShapes(scene) || std::ranges::any_of(scene.media, Emits);
  const bool has_sky = std::ranges::any_of(scene.lights, IsSky);
  if (format == SceneFormat::kGltf && (!has_light || (is_empty && !has_sky))) {
    return absl::StrCat(place, is_empty ? "no mesh is shown" : "nothing in the file emits light",
                        ", so the image will be black; name an image of what surrounds the scene "
                        "by --environment, or leave out --environment none");
  }
  if (!has_light) {
    return absl::StrCat(place, is_empty ? "the scene is empty" : "nothing in the scene emits light",
                        ", so the image will be black; add after WorldBegin ",
                        is_empty ? "a Shape and " : "",
                        "a light, for example LightSource \"infinite\", or AreaLightSource "
                        "\"diffuse\" before a Shape");
  }
  if (!is_empty || has_sky) return "";
  return absl::StrCat(place,
                      "the scene has no shapes, and its lights are not visible themselves, so the "
                      "image will be black; add a Shape after WorldBegin");
}

}  // namespace sheaf
