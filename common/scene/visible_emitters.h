// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bounds of the regions of the image where emitters may be visible, computed from the scene alone
// without tracing rays.
#pragma once

#include <cstdint>
#include <vector>

#include "common/film/tile_geometry.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Bounds in pixels of the frame, not clipped to it, of shapes with an area light; hidden shapes are
// included. Covers only shapes at rest in the world that lie wholly in front of a static
// perspective or orthographic camera. width_px, height_px: of the frame.
std::vector<PixelRect> VisibleEmitters(const SceneDescription& scene, int32_t width_px,
                                       int32_t height_px);

}  // namespace sheaf
