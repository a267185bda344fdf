// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/ray_visibility.h"

#include <algorithm>
#include <optional>
#include <variant>

#include "absl/strings/str_cat.h"

namespace sheaf::render {
namespace {

bool Has(RayKinds kinds, RayKind kind) { return (kinds & BitOf(kind)) != 0; }

// Whether rays meet the shape, unless they do not see it, but always pass.
bool BlocksNothing(const SceneDescription& scene, const ShapeDescription& shape) {
  return shape.material != kNone && !shape.media.Separates() &&
         std::holds_alternative<InterfaceMaterial>(
             scene.materials[static_cast<size_t>(shape.material)].material);
}

// Sets what infinite lights are invisible to.
absl::Status SetSky(const SceneDescription& scene, const FrameSettings& settings,
                    RayVisibility* visibility) {
  const LightDescription* first = nullptr;
  for (const LightDescription& light : scene.lights) {
    if (!std::holds_alternative<InfiniteLight>(light.light)) continue;
    if (first == nullptr) first = &light;
    if (light.invisible == first->invisible) continue;
    if (!settings.outputs.light_groups.empty() && !settings.outputs.light_paths) {
      return absl::InvalidArgumentError(absl::StrCat(
          FormatLocation(scene, light.location),
          ": LightSource \"infinite\": its \"invisible\" differs from that of the infinite light "
          "at ",
          FormatLocation(scene, first->location),
          ", which frames with groups of lights do not know; give all infinite lights the same, or "
          "leave out --light-groups"));
    }
    visibility->skies_differ = true;
  }
  if (first != nullptr && !visibility->skies_differ) visibility->sky = first->invisible;
  return absl::OkStatus();
}

// The shape of an emitter of the world.
const Surface& SurfaceOf(const SceneGeometry& geometry, const EmitterRange& range) {
  const GeometryGroup& world = geometry.groups[0];
  return range.geometry < world.meshes.size() ? world.meshes[range.geometry].surface
                                              : world.quadrics[range.primitive].surface;
}

}  // namespace

absl::StatusOr<RayVisibility> MakeRayVisibility(const SceneDescription& scene,
                                                const FrameSettings& settings,
                                                const SceneGeometry& geometry,
                                                const LightTable& lights) {
  RayVisibility visibility;
  if (absl::Status status = SetSky(scene, settings, &visibility); !status.ok()) return status;
  const auto note_lobes = [&](RayKinds invisible) {
    visibility.splits_lobes |=
        Has(invisible, RayKind::kDiffuse) != Has(invisible, RayKind::kGlossy);
  };
  note_lobes(visibility.sky);
  for (const ShapeDescription& shape : scene.shapes) {
    note_lobes(shape.invisible);
    if (BlocksNothing(scene, shape)) continue;
    const RayKinds hidden = shape.invisible & kScatteredRays;
    visibility.splits_shadow |=
        hidden != (Has(shape.invisible, RayKind::kShadow) ? kScatteredRays : RayKinds{0});
  }
  std::vector<RayKinds>& of_lights = visibility.lights;
  of_lights.resize(lights.light_count());
  for (uint32_t i = 0; i < of_lights.size(); ++i) {
    const int32_t description = lights.DescriptionOf(i);
    if (description == kNone) continue;
    of_lights[i] = scene.lights[static_cast<size_t>(description)].invisible;
    note_lobes(of_lights[i]);
  }
  for (const EmitterRange& range : geometry.emitters) {
    const RayKinds invisible = SurfaceOf(geometry, range).invisible;
    std::fill_n(of_lights.begin() + range.first, range.count, invisible);
  }
  return visibility;
}

}  // namespace sheaf::render
