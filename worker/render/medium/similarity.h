// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SimilarityNotes: the notes of a plan about --similarity: its effect on the media of a scene and
// on the image. MediumTable computes the reduced media.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/scene_description.h"

namespace sheaf::render {

// Empty for after = 0. after: FrameSettings::similarity_after.
std::vector<std::string> SimilarityNotes(const SceneDescription& scene, int32_t after);

}  // namespace sheaf::render
