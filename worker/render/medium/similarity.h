// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What --similarity does to the media of a scene, and what that does to its picture: the lines that
// a plan has about it. The reduced media themselves are MediumTable's.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/scene_description.h"

namespace sheaf::render {

// None for after = 0. after: FrameSettings::similarity_after.
std::vector<std::string> SimilarityNotes(const SceneDescription& scene, int32_t after);

}  // namespace sheaf::render
