// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The mix materials of a scene as a graph, in which materials may be shared.
#pragma once

#include <cstdint>

#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Reports a mix that contains itself, and a mix with more than depth_max levels of mixes. Visits
// each material once.
void CheckMixes(const SceneDescription& scene, uint32_t depth_max, Diagnostics* diagnostics);

}  // namespace sheaf
