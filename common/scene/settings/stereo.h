// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Stereo frames: two eyes beside the scene's camera, whose paths are shared
// (worker/render/eyes/shared_vertex.h, docs/adr/0150). The film of a frame is that of both eyes
// side by side, the left one first, so tiles, parts and images are as those of any frame of that
// size.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf {

// Makes *resolved, complete otherwise, those of a stereo frame: doubles the film's width.
// Techniques that the scene's integrator alone asks for are left out. Errors: kInvalidArgument for
// a camera that is not a perspective one, for distances out of range, and for what stereo frames do
// not have: a crop, other techniques, several light samples, outputs beside the image.
absl::Status MakeStereo(const SceneDescription& scene, const RenderSettings& settings,
                        FrameSettings* resolved);

// Why the settings cannot be those of a stereo frame; empty if they can. Requires:
// settings.IsStereo().
std::string WhyNoStereo(const FrameSettings& settings);

// Whether both distances are such that a frame may have them.
bool AreEyeDistances(float eye_distance, float eye_convergence);

}  // namespace sheaf
