// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Grids in scene files that have one value in all cells. Densities are interpolated, and fall to 0
// from the outermost values on, half a cell before the grid's box ends. A medium whose boundary
// stays within the outermost values never shows that: it is homogeneous, and paths through it need
// no tracking. What cannot be proved from the description stays a grid.
#pragma once

#include "common/scene/scene_description.h"

namespace sheaf {

// Makes such media homogeneous, and says in MediumDescription::constant_grid which, and why others
// are not. Requires: the scene's media, shapes, instances and camera are read, without errors.
void TakeConstantGridsAsHomogeneous(SceneDescription* scene);

}  // namespace sheaf
