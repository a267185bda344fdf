// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The inside of shapes of principled materials, for every reader of scenes, and what the materials
// emit.
#pragma once

#include <cstdint>

#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// The principled material of a shape, also one with an alpha, which is a mix. kNone: another.
int32_t PrincipledOf(const SceneDescription& scene, int32_t material);

// Adds what principled materials absorb inside (KHR_materials_volume) to the media, and sets it
// inside the shapes of those materials that have no medium yet. Warns of curves.
// Requires: materials and shapes have been read without errors.
void AddPrincipledMedia(SceneDescription* scene, Diagnostics* diagnostics);

// Adds what principled materials emit to the shapes of those materials that have no area light of
// their own. Warns of shapes of objects, which emit no light.
void AddPrincipledEmission(SceneDescription* scene, Diagnostics* diagnostics);

}  // namespace sheaf
