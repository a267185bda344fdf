// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Where in the picture lamps may be seen, told from the scene alone: no ray is traced.
#pragma once

#include <cstdint>
#include <vector>

#include "common/film/tile_geometry.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Bounds on the frame, in pixels and not cut to it, of shapes with an area light; of hidden ones
// too. Only of shapes that stand still in the world before a still perspective or orthographic
// camera, and wholly on its far side. width_px, height_px: of the frame.
std::vector<PixelRect> LampsInView(const SceneDescription& scene, int32_t width_px,
                                   int32_t height_px);

}  // namespace sheaf
