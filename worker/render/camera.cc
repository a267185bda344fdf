// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Cameras from their descriptions.
#include "worker/render/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "absl/strings/str_cat.h"
#include "common/math/elementary.h"

namespace sheaf::render {

Vec2d SampleUnitDisk(Vec2f u) {
  const double x = 2 * static_cast<double>(u.x) - 1, y = 2 * static_cast<double>(u.y) - 1;
  if (x == 0 && y == 0) return {0, 0};
  double radius = x, angle = 0;
  if (std::fabs(x) > std::fabs(y)) {
    angle = (std::numbers::pi / 4) * (y / x);
  } else {
    radius = y;
    angle = (std::numbers::pi / 2) - (std::numbers::pi / 4) * (x / y);
  }
  const auto turn = SinCos(angle);
  return {radius * turn.cos, radius * turn.sin};
}

absl::StatusOr<Camera> Camera::Make(const SceneDescription& scene, int32_t width_px,
                                    int32_t height_px, Vec3d render_origin_world) {
  const CameraDescription& description = scene.camera;
  const auto fail = [&](const std::string& what) {
    return absl::InvalidArgumentError(
        absl::StrCat(FormatLocation(scene, description.location), ": Camera: ", what));
  };
  Camera camera;
  camera.is_orthographic_ = description.kind == CameraDescription::Kind::kOrthographic;
  double scale = 1;
  if (!camera.is_orthographic_) {
    if (!(description.fov_degrees > 0 && description.fov_degrees < 180)) {
      return fail(
          absl::StrCat("\"float fov\" ", description.fov_degrees, " is outside (0, 180) degrees"));
    }
    scale = Tan(0.5 * static_cast<double>(description.fov_degrees) * (std::numbers::pi / 180));
  }
  const double* window = description.screen_window;
  const double step_x = scale * (window[1] - window[0]) / width_px;
  const double step_y = scale * (window[3] - window[2]) / height_px;
  if (!std::isfinite(step_x) || !std::isfinite(step_y) || step_x == 0 || step_y == 0) {
    return fail("\"float screenwindow\" is empty or not finite");
  }
  camera.screen_origin_ = {scale * window[0], scale * window[3]};
  camera.screen_step_ = {step_x, -step_y};
  camera.lens_radius_ = description.lens_radius;
  if (camera.lens_radius_ > 0) {
    if (!(description.focal_distance > 0)) {
      return fail(absl::StrCat("\"float focaldistance\" ", description.focal_distance,
                               " must be above 0 where \"float lensradius\" is"));
    }
    camera.inverse_focal_distance_ = 1 / static_cast<double>(description.focal_distance);
  }
  absl::StatusOr<AnimatedTransform> transform =
      AnimatedTransform::Make(description.world_from_camera);
  if (!transform.ok()) return fail(std::string(transform.status().message()));
  camera.world_from_camera_ = *transform;
  camera.shutter_open_ = description.shutter_open;
  camera.shutter_close_ = std::max(description.shutter_open, description.shutter_close);
  camera.moves_ =
      description.world_from_camera.IsAnimated() && camera.shutter_close_ > camera.shutter_open_;
  camera.render_origin_world_ = render_origin_world;
  camera.render_from_camera_ = camera.RenderFromCameraAt(0);
  return camera;
}

Affine Camera::RenderFromCameraAt(float shutter_fraction) const {
  Affine transform = world_from_camera_.At(
      shutter_open_ + (shutter_close_ - shutter_open_) * static_cast<double>(shutter_fraction));
  transform.offset = transform.offset - render_origin_world_;
  return transform;
}

}  // namespace sheaf::render
