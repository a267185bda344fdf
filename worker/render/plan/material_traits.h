// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What a material asks of the renderer, read off its description: which effects it calls for and
// what a hit must compute for it.
#pragma once

#include <cstdint>

#include "common/scene/scene_description.h"

namespace sheaf::render {

struct MaterialNeeds {
  uint32_t traits = 0;       // Of enum Trait; for a mix, of all it may turn into.
  bool may_pass = false;     // An interface (glass of index 1 is one), or a mix.
  bool anisotropic = false;  // Scatters differently along u and v.
  bool reads_textures = false;
  bool has_normal_map = false;  // Or a bump map.
  bool paints_matter = false;   // The reflectance of what is inside is a texture.
};

// Requires: material is kNone (a grey diffuse surface) or an index; mixes hold no cycle.
MaterialNeeds NeedsOfMaterial(const SceneDescription& scene, int32_t material);

}  // namespace sheaf::render
