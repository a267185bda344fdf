// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialTable: the scene's materials and textures made ready to be evaluated at hits.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/bsdf.h"

namespace sheaf::render {

// What textures see of a hit.
struct TexturePoint {
  Vec2f uv;
  Vec2f duv_dx, duv_dy;   // Footprint: change of uv per pixel; 0 means point look-up.
  Vec3f p_world;          // World space (not camera-relative), for 3-D and projected mappings.
};

class MaterialTable {
 public:
  // Errors: a texture that cannot be opened or decoded, named with its location; values outside
  // their range (roughness below 0, reflectance above 1 is clamped and warned about once).
  static absl::StatusOr<std::unique_ptr<MaterialTable>> Build(const SceneDescription& scene,
                                                              FileSource& files,
                                                              uint64_t texture_cache_bytes_max);
  ~MaterialTable();

  // The Bsdf of a material at a point. Mixes are decided by u_mix (consumed down the tree without
  // losing uniformity). wo_local_z_positive: whether wo is on the +z side (orients dielectrics).
  template <uint32_t kTraits>
  Bsdf Evaluate(int32_t material, const TexturePoint& point, float u_mix) const;
  // Value of a float input (cut-outs), in [0, 1] for alpha.
  template <uint32_t kTraits>
  float EvaluateFloat(const FloatInput& input, const TexturePoint& point) const;

  struct Impl;

 private:
  MaterialTable();
  std::unique_ptr<Impl> impl_;
};

}  // namespace sheaf::render
