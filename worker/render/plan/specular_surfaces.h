// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The surfaces of a scene that scatter specularly alone: light paths can be merged behind them, and
// views share less of the paths that begin at them.
#pragma once

#include <string>
#include <vector>

#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::render {

// Whether a material may scatter specularly alone, as smooth glass and mirrors do. True also where
// only a texture knows.
bool MayHaveSpecularSurfaces(const SceneDescription& scene);

// Whether a material may have a glossy lobe by which lights are chosen (Technique::kProduct): a
// rough conductor or coat, or a rough principled surface other than glass. True also where only a
// texture knows.
bool MayHaveGlossySurfaces(const SceneDescription& scene);

// One line about the eyes of a stereo frame: that they share paths, and the materials at which they
// share less or none, because each eye has directions of its own there.
std::string StereoNote(const SceneDescription& scene);
// The same about a frame with Technique::kSharing, and which views share paths if it has kViews,
// too. world_moves: whether anything but the camera moves.
std::string SharingNote(const SceneDescription& scene, bool by_views, bool world_moves);
// Adds those of the two that the settings ask for.
void NoteSharedPaths(const SceneDescription& scene, const FrameSettings& settings, bool world_moves,
                     std::vector<std::string>* notes);

}  // namespace sheaf::render
