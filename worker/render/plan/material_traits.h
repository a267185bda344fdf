// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialNeedsTable: the renderer features that each material requires, from its description: the
// traits, and the values that a hit must compute.
#pragma once

#include <cstdint>
#include <vector>

#include "common/scene/scene_description.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

struct MaterialNeeds {
  TraitBits traits = 0;      // Bits of enum Trait; for a mix, those of all its materials.
  bool may_pass = false;     // An interface (glass of index 1 is one), or a mix.
  bool is_boundary = false;  // Light passes into the body behind it: glass, an interface, tissue.
  bool anisotropic = false;  // The BSDF depends on the tangent.
  bool reads_textures = false;
  bool has_normal_map = false;          // Or a bump map.
  bool has_subsurface_texture = false;  // The subsurface reflectance is a texture.
};

// Finds the needs of each material once: many shapes share one, and mixes share what they mix.
class MaterialNeedsTable {
 public:
  explicit MaterialNeedsTable(const SceneDescription& scene);
  // Requires: material is kNone (a gray diffuse surface) or an index.
  const MaterialNeeds& Of(int32_t material) const {
    return material == kNone ? none_ : needs_[static_cast<size_t>(material)];
  }

 private:
  MaterialNeeds none_;
  std::vector<MaterialNeeds> needs_;
};

}  // namespace sheaf::render
