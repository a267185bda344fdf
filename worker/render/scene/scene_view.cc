// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/scene_view.h"

#include <utility>

#include "absl/status/statusor.h"
#include "worker/render/plan/render_plan.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

// Farther from the origin than this many extents of the scene, the camera's coordinates take too
// many bits of those of the scene (as in SceneBaker::ChooseOrigin).
constexpr double kFarInExtents = 4096;

// The traits that a camera needs.
TraitBits TraitsOf(const CameraDescription& camera) {
  const bool is_open = camera.shutter_close > camera.shutter_open;
  TraitBits traits = 0;
  if (camera.lens_radius > 0 || camera.IsRealistic())
    traits |= static_cast<TraitBits>(Trait::kLens);
  if (camera.Clips()) traits |= static_cast<TraitBits>(Trait::kRayVisibility);
  if (camera.world_from_camera.IsAnimated() && is_open)
    traits |= static_cast<TraitBits>(Trait::kMotion);
  return traits;
}

bool IsFar(const Camera& camera, const SceneView& view, const SceneGeometry& geometry) {
  const Ray ray = camera.MakeRay<0>({view.width_px / 2.0, view.height_px / 2.0}, {}, 0);
  const double extent = Length(ToDouble(geometry.bounds_upper) - ToDouble(geometry.bounds_lower));
  return extent > 0 && Length(ToDouble(ray.o)) > kFarInExtents * extent;
}

}  // namespace

void FindInteriorsOfCamera(CompiledScene* scene) {
  if (!scene->interiors) return;
  const FrameSettings& film = scene->settings;
  const Ray center = scene->camera.MakeRay<0>({film.width_px / 2.0, film.height_px / 2.0}, {}, 0);
  scene->interiors->FindEnclosing(scene->geometry, *scene->tracer, center.o);
}

absl::Status SetView(const SceneView& view, FileSource& files, CompiledScene* scene) {
  const CameraDescription& old = scene->description.camera;
  const bool same_shutter = view.camera.shutter_open == old.shutter_open &&
                            view.camera.shutter_close == old.shutter_close;
  if ((TraitsOf(view.camera) & ~scene->plan.traits) != 0 || !same_shutter ||
      scene->geometry.radius_if_far > 0) {
    return absl::FailedPreconditionError("the scene has to be compiled for this camera");
  }
  CameraDescription camera = view.camera;
  camera.medium = old.medium;
  std::swap(scene->description.camera, camera);
  absl::StatusOr<Camera> made = Camera::Make(scene->description, view.width_px, view.height_px,
                                             scene->geometry.render_origin_world, &files);
  absl::Status status = made.status();
  if (made.ok() && IsFar(*made, view, scene->geometry)) {
    status = absl::FailedPreconditionError("the camera is far away from the scene");
  }
  if (!status.ok()) {
    std::swap(scene->description.camera, camera);
    return status;
  }
  scene->camera = *std::move(made);
  scene->description.film.width_px = scene->settings.width_px = view.width_px;
  scene->description.film.height_px = scene->settings.height_px = view.height_px;
  scene->settings.window = view.window;
  FindInteriorsOfCamera(scene);
  return absl::OkStatus();
}

}  // namespace sheaf::render
