// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EyeCamera: the cameras of the two eyes of a stereo frame.
#pragma once

#include <cstdint>

#include "common/scene/scene_description.h"

namespace sheaf::render {

enum class Eye : uint8_t { kLeft = 0, kRight = 1 };
constexpr Eye OtherThan(Eye eye) { return eye == Eye::kLeft ? Eye::kRight : Eye::kLeft; }

// The camera of an eye that is half of eye_distance beside the camera, along the camera's x, and
// looks in the same direction. convergence: where both eyes see a point on the camera's axis in the
// middle of their images, as a distance along the axis; 0: at infinity. The eyes' films are shifted
// to that end, not turned, so that rows of both images show the same points. Both distances: in the
// units of the camera's space. Requires: a perspective camera; convergence >= 0.
CameraDescription EyeCamera(const CameraDescription& camera, Eye eye, float eye_distance,
                            float convergence);

}  // namespace sheaf::render
