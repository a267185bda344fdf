// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Scenes whose picture must be black, told before anybody renders them.
#pragma once

#include <string>

#include "common/scene/scene_description.h"

namespace sheaf {

// Why every pixel will be black and what to add, as a diagnostic says it; empty where light may
// come to the camera.
std::string WhyBlack(const SceneDescription& scene);

}  // namespace sheaf
