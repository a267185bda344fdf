// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Grids in scene files that have the same value in all cells. Densities are interpolated, and fall
// to 0 beyond the centers of the outermost cells, within the last half cell of the grid's box. If
// the boundary of the medium lies within those centers, this falloff is never seen: the medium is
// homogeneous, and paths through it need no tracking. A grid stays a grid unless the description
// proves this.
#pragma once

#include "common/scene/scene_description.h"

namespace sheaf {

// Makes such media homogeneous. MediumDescription::constant_grid says which ones, and why the
// others stay grids.
// Requires: the scene's media, shapes, instances and camera have been read without errors.
void ConvertConstantGrids(SceneDescription* scene);

}  // namespace sheaf
