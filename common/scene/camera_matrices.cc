// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/camera_matrices.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/math/elementary.h"
#include "common/math/transform.h"

namespace sheaf {
namespace {

// From Matrix4, whose points are columns. Empty where a number is not finite.
std::vector<float> RowsOf(const Matrix4& matrix) {
  std::vector<float> rows;
  for (size_t i = 0; i < 4; ++i) {
    // Adding 0 turns -0 into 0.
    for (size_t k = 0; k < 4; ++k) rows.push_back(static_cast<float>(matrix.m[k][i]) + 0.0f);
  }
  const bool is_finite = std::ranges::all_of(rows, [](float v) { return std::isfinite(v); });
  return is_finite ? rows : std::vector<float>{};
}

// The inverse of Camera's mapping of the film to the screen (worker/render/camera).
Matrix4 NdcFromCamera(const CameraDescription& camera) {
  const bool is_perspective = camera.kind == CameraDescription::Kind::kPerspective;
  const double scale =
      is_perspective ? Tan(static_cast<double>(camera.fov_degrees) * (std::numbers::pi / 360)) : 1;
  const double* const window = camera.screen_window;
  const double width = window[1] - window[0], height = window[3] - window[2];
  const double x0 = -window[0] / width, y0 = window[3] / height;
  Matrix4 matrix;
  matrix.m = {{{1 / (scale * width), 0, is_perspective ? x0 : 0, is_perspective ? 0 : x0},
               {0, -1 / (scale * height), is_perspective ? y0 : 0, is_perspective ? 0 : y0},
               {0, 0, 1, 0},
               {0, 0, is_perspective ? 1.0 : 0.0, is_perspective ? 0.0 : 1.0}}};
  return matrix;
}

}  // namespace

CameraMatrices CameraMatricesOf(const CameraDescription& camera) {
  CameraMatrices matrices;
  Matrix4 camera_from_world;
  if (!Invert(camera.world_from_camera.start, &camera_from_world)) return matrices;
  matrices.world_to_camera = RowsOf(camera_from_world);
  if (camera.kind == CameraDescription::Kind::kPerspective ||
      camera.kind == CameraDescription::Kind::kOrthographic) {
    matrices.world_to_ndc = RowsOf(NdcFromCamera(camera) * camera_from_world);
  }
  return matrices;
}

}  // namespace sheaf
