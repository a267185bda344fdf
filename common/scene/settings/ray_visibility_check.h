// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The techniques of scenes with shapes or lights that rays of some kinds do not see: paths that
// begin at lights, and paths that pixels or eyes share, do not know the kinds of their rays.
#pragma once

#include "absl/status/status.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf {

// Where the scene first makes a shape or light invisible to some rays, or else has a camera that
// does not see what is near or far; null if it does neither.
const SourceLocation* FirstInvisible(const SceneDescription& scene);
// The techniques without those that do not know the kinds of rays.
TechniqueSet KnowingRayKinds(TechniqueSet techniques);
// kInvalidArgument where the scene is such and the settings have other techniques, or two eyes.
absl::Status CheckRayVisibility(const SceneDescription& scene, const FrameSettings& settings);

}  // namespace sheaf
