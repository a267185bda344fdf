// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Refuses light paths in commands that only handle paths from the camera: measurements of effects
// would report the costs and errors of a part of the image.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::cli {

// what: the refused thing, in the plural ("measurements of effects"). Errors: kInvalidArgument if
// the techniques have light paths, with what to do.
absl::Status CheckCameraPaths(const std::string& what, TechniqueSet techniques);
// The same; the error begins with the place of the scene's integrator if that requests them.
absl::Status CheckCameraPaths(const std::string& what, const SceneDescription& scene,
                              const FrameSettings& settings);

}  // namespace sheaf::cli
