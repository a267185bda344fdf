// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/eyes/path_views.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

// The generators of the lattices of 1, 2, 4 and 8 points, over their number of points.
constexpr int32_t kGenerators[][3] = {{0, 0, 0}, {1, 1, 1}, {1, 2, 1}, {1, 3, 5}};
static_assert(kPathSharesMax == 8);

// u + steps / count, modulo 1.
float Rotated(float u, int32_t steps, int32_t count) {
  const float sum = u + static_cast<float>(steps % count) / static_cast<float>(count);
  return sum < 1 ? sum : sum - 1;
}

// The distance on the film, in pixels, of the images of p; 0 where one of them does not exist.
double FilmDistance(const std::optional<CameraConnection>& a,
                    const std::optional<CameraConnection>& b) {
  if (!a || !b) return 0;
  const double distance = std::hypot(a->film.x - b->film.x, a->film.y - b->film.y);
  return std::isfinite(distance) ? distance : 0;
}

// Whether anything but the camera may move or deform.
bool WorldMoves(const CompiledScene& scene) {
  const SceneDescription& description = scene.description;
  return std::ranges::any_of(
             description.shapes,
             [](const ShapeDescription& shape) { return shape.world_from_object.IsAnimated(); }) ||
         std::ranges::any_of(description.instances,
                             [](const ObjectInstance& instance) {
                               return instance.world_from_instance.IsAnimated();
                             }) ||
         std::ranges::any_of(description.media,
                             [](const MediumDescription& medium) { return medium.Moves(); }) ||
         std::ranges::any_of(scene.geometry.groups, [](const GeometryGroup& group) {
           return std::ranges::any_of(group.meshes,
                                      [](const BakedMesh& mesh) { return !mesh.steps.empty(); });
         });
}

}  // namespace

PathSharing SharingOf(const CompiledScene& scene) {
  const TechniqueSet techniques = scene.settings.techniques;
  const CameraDescription& camera = scene.description.camera;
  PathSharing sharing;
  sharing.by_filter = SharesPaths(techniques);
  if (!SharesViews(techniques)) return sharing;
  // Rays through a realistic lens tell its points only where they begin at it.
  sharing.through_lens =
      camera.IsRealistic() ? scene.geometry.radius_if_far == 0 : camera.lens_radius > 0;
  sharing.over_shutter = Has(scene.plan.traits, Trait::kMotion) && !WorldMoves(scene);
  if (sharing.through_lens || sharing.over_shutter) sharing.shares_max = kPathSharesMax;
  return sharing;
}

const Camera& CameraOf(const CompiledScene& scene, Eye eye) {
  return scene.eyes == nullptr ? scene.camera : scene.eyes->of(eye);
}

int32_t FilmWidthOf(const CompiledScene& scene) {
  return scene.eyes == nullptr ? scene.settings.width_px : scene.eyes->width_px;
}

PathView ViewOf(const CompiledScene& scene, const PathSharing& sharing, const PathOrigin& origin,
                Eye eye, int32_t count, int32_t i) {
  const int32_t* generator =
      kGenerators[static_cast<size_t>(std::countr_zero(static_cast<uint32_t>(count)))];
  PathView view{eye, origin.lens};
  if (sharing.through_lens) {
    view.lens = {Rotated(origin.lens.x, i * generator[0], count),
                 Rotated(origin.lens.y, i * generator[1], count)};
  }
  const float u =
      sharing.over_shutter ? Rotated(origin.time_u, i * generator[2], count) : origin.time_u;
  view.time = CameraOf(scene, eye).ShutterFraction(u);
  return view;
}

int32_t SharesAt(const CompiledScene& scene, const PathSharing& sharing, Vec3f p, float time) {
  if (sharing.shares_max <= 1) return 1;
  // Times of the path's own would make the number depend on more than the vertex.
  if (sharing.over_shutter) time = 0.5f;
  // Half of the radius of the lens apart: beyond it, a realistic one may be blocked.
  constexpr Vec2f kMiddle{0.5f, 0.5f}, kBeside{0.25f, 0.5f};
  double wanted = 0;
  if (sharing.through_lens) {
    wanted += 4 / kLensPixelsPerShare *
              FilmDistance(scene.camera.SampleWi(p, kMiddle, time),
                           scene.camera.SampleWi(p, kBeside, time));
  }
  if (sharing.over_shutter) {
    wanted +=
        1 / kShutterPixelsPerShare *
        FilmDistance(scene.camera.SampleWi(p, kMiddle, 0), scene.camera.SampleWi(p, kMiddle, 1));
  }
  int32_t shares = 1;
  while (2 * shares <= sharing.shares_max && 2 * shares <= wanted) shares *= 2;
  return shares;
}

}  // namespace sheaf::render
