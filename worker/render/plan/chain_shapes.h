// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The shapes that chains of smooth interfaces lead through, and the lamps that they lead to
// (integrator/chains.h). All other light is left to paths from the camera.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/scene_description.h"

namespace sheaf::render {

struct ChainShapes {
  // Indices in SceneDescription::shapes, ascending. A caster is smooth glass or metal that stands
  // still in the world; a lamp is small against the largest caster, and still. Lamps are empty
  // where casters are.
  std::vector<int32_t> casters, lamps;
  // One line each: the reasons for the choice.
  std::vector<std::string> notes;
};

ChainShapes FindChainShapes(const SceneDescription& scene);

}  // namespace sheaf::render
