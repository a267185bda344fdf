// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The surfaces of a scene that scatter specularly alone: light paths can be merged behind them, and
// eyes do not share the paths that begin at them.
#pragma once

#include <string>

#include "common/scene/scene_description.h"

namespace sheaf::render {

// Whether a material may scatter specularly alone, as smooth glass and mirrors do. True also where
// only a texture knows.
bool MayHaveSpecularSurfaces(const SceneDescription& scene);

// One line about the eyes of a stereo frame: that they share paths, and the materials at which they
// do not, because each eye has directions of its own there.
std::string StereoNote(const SceneDescription& scene);

}  // namespace sheaf::render
