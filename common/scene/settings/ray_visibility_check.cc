// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/ray_visibility_check.h"

#include <string>

#include "absl/strings/str_cat.h"

namespace sheaf {

const SourceLocation* FirstInvisible(const SceneDescription& scene) {
  for (const ShapeDescription& shape : scene.shapes) {
    if (shape.invisible != 0) return &shape.location;
  }
  for (const LightDescription& light : scene.lights) {
    if (light.invisible != 0) return &light.location;
  }
  if (scene.camera.Clips()) return &scene.camera.location;
  return nullptr;
}

TechniqueSet KnowingRayKinds(TechniqueSet techniques) {
  return techniques.Without(Technique::kLightPaths)
      .Without(Technique::kSharing)
      .Without(Technique::kMutations)
      .Without(Technique::kChains);
}

absl::Status CheckRayVisibility(const SceneDescription& scene, const FrameSettings& settings) {
  const TechniqueSet known = KnowingRayKinds(settings.techniques);
  if (settings.techniques == known && !settings.IsStereo()) return absl::OkStatus();
  const SourceLocation* invisible = FirstInvisible(scene);
  if (invisible == nullptr) return absl::OkStatus();
  const char* parameter = invisible == &scene.camera.location
                              ? ": \"nearclip\" or \"farclip\": the scene "
                              : ": \"invisible\": the scene ";
  const std::string place = absl::StrCat(FormatLocation(scene, *invisible), parameter);
  if (settings.IsStereo()) {
    return absl::InvalidArgumentError(absl::StrCat(
        place,
        "has no stereo frames, as both eyes share paths, whose rays are of several kinds; "
        "render an image for each eye"));
  }
  return absl::InvalidArgumentError(absl::StrCat(
      place, "has paths from the camera alone, not the techniques ", settings.techniques.Name(),
      ", which do not know the kinds of their rays; give --techniques ", known.Name()));
}

}  // namespace sheaf
