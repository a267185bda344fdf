// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Detects, before rendering, scenes whose image must be black.
#pragma once

#include <string>

#include "common/scene/scene_description.h"

namespace sheaf {

enum class SceneFormat { kPbrt, kGltf };

// The reason why every pixel is black, and what to add, as a diagnostic's text. Empty if light may
// reach the camera.
std::string WhyBlack(const SceneDescription& scene, SceneFormat format = SceneFormat::kPbrt);

}  // namespace sheaf
