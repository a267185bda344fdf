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

absl::StatusOr<RayKinds> OfSky(const SceneDescription& scene) {
  const LightDescription* first = nullptr;
  for (const LightDescription& light : scene.lights) {
    if (!std::holds_alternative<InfiniteLight>(light.light)) continue;
    if (first == nullptr) first = &light;
    if (light.invisible == first->invisible) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        FormatLocation(scene, light.location),
        ": LightSource \"infinite\": its \"invisible\" differs from that of the infinite light at ",
        FormatLocation(scene, first->location), "; give all infinite lights the same"));
  }
  return first == nullptr ? RayKinds{0} : first->invisible;
}

// The shape of an emitter of the world.
const Surface& SurfaceOf(const SceneGeometry& geometry, const EmitterRange& range) {
  const GeometryGroup& world = geometry.groups[0];
  return range.geometry < world.meshes.size() ? world.meshes[range.geometry].surface
                                              : world.quadrics[range.primitive].surface;
}

}  // namespace

absl::StatusOr<RayVisibility> MakeRayVisibility(const SceneDescription& scene,
                                                const SceneGeometry& geometry,
                                                const LightTable& lights) {
  RayVisibility visibility;
  const absl::StatusOr<RayKinds> sky = OfSky(scene);
  if (!sky.ok()) return sky.status();
  visibility.sky = *sky;
  const auto note_lobes = [&](RayKinds invisible) {
    visibility.splits_lobes |=
        Has(invisible, RayKind::kDiffuse) != Has(invisible, RayKind::kGlossy);
  };
  note_lobes(*sky);
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
