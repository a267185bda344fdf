// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera/eye_camera.h"

#include <numbers>

#include "common/math/elementary.h"
#include "common/math/transform.h"

namespace sheaf::render {

CameraDescription EyeCamera(const CameraDescription& camera, Eye eye, float eye_distance,
                            float convergence) {
  const double beside = (eye == Eye::kLeft ? -0.5 : 0.5) * static_cast<double>(eye_distance);
  CameraDescription description = camera;
  const Matrix4 camera_from_eye = TranslateMatrix({beside, 0, 0});
  description.world_from_camera.start = camera.world_from_camera.start * camera_from_eye;
  description.world_from_camera.end = camera.world_from_camera.end * camera_from_eye;
  if (!(convergence > 0)) return description;
  // A point on the axis at the distance z appears at x = -beside / z of the screen, whose unit is
  // the tangent of half the field of view.
  const double half_fov = 0.5 * static_cast<double>(camera.fov_degrees) * (std::numbers::pi / 180);
  const double shift = -beside / static_cast<double>(convergence) / Tan(half_fov);
  description.screen_window[0] += shift;
  description.screen_window[1] += shift;
  return description;
}

}  // namespace sheaf::render
