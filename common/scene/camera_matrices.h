// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The matrices of a camera as image files state them, so that other programs can place things in
// the image.
#pragma once

#include <vector>

#include "common/scene/scene_description.h"

namespace sheaf {

// Each empty or 16 numbers, row by row; a point is a row that is multiplied from the left. Source:
// OpenEXR 3.1, ImfStandardAttributes.h (worldToCamera, worldToNDC).
struct CameraMatrices {
  // To the camera's space when the shutter opens: x right, y up, z ahead, in scene units.
  std::vector<float> world_to_camera;
  // To the frame: after division by w, (0, 0) is its upper left corner and (1, 1) its lower right
  // one. Only perspective and orthographic cameras have it.
  std::vector<float> world_to_ndc;
};

// Both empty where the camera's transformation is singular.
CameraMatrices CameraMatricesOf(const CameraDescription& camera);

}  // namespace sheaf
