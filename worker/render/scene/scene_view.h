// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SetView: a compiled scene is seen by another camera, without being compiled again.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "common/film/tile_geometry.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {

struct SceneView {
  CameraDescription camera;  // Its medium is ignored: the scene's camera has kept its own.
  int32_t width_px = 0, height_px = 0;  // The film, both above 0.
  PixelRect window;                     // The rendered part of it.
};

// Gives the scene this view. Requires: the scene was compiled for one eye and for paths from the
// camera, with CompileTechniques::merge_media off, and no other thread uses it. Images of a moved
// camera differ from those of a scene that was compiled for it by rounding: the origin of its
// coordinates stays.
// Errors: kFailedPrecondition where the scene has to be compiled for the view, as it has a lens or
// planes that cut, moves, or is so far away that coordinates are too coarse; those of Camera::Make.
// After an error the scene has its last view.
absl::Status SetView(const SceneView& view, FileSource& files, CompiledScene* scene);

// Finds the interiors that the scene's camera is in. Requires: the scene has its tracer, and no
// other thread uses it.
void FindInteriorsOfCamera(CompiledScene* scene);

}  // namespace sheaf::render
