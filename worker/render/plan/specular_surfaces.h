// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MayHaveSpecularSurfaces: whether light paths can be merged behind any surface of the scene.
#pragma once

#include "common/scene/scene_description.h"

namespace sheaf::render {

// Whether a material may scatter specularly alone, as smooth glass and mirrors do. True also where
// only a texture knows.
bool MayHaveSpecularSurfaces(const SceneDescription& scene);

}  // namespace sheaf::render
