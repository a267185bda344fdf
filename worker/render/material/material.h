// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialTable: the scene's materials and textures made ready to be evaluated at hits. A material
// of constants is a Bsdf made once, tables included; only what varies over a surface costs at a
// hit.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/geometry/tangent_plane.h"

namespace sheaf::render {

// What textures see of a hit.
struct TexturePoint {
  Vec2f uv;
  Vec3f p_world;  // World space (not camera-relative), for 3-D and projected mappings.
};

struct MaterialOptions {
  uint64_t texture_cache_bytes_max = 0;
  bool spectral = false;           // Evaluate may be asked for traits with kSpectral too.
  bool single_scattering = false;  // As RenderSettings has it.
};

class MaterialTable {
 public:
  // Errors: a texture that cannot be opened or decoded, named with its location; values outside
  // their range. Reflectance outside [0, 1] is clamped, and warned about where it is a constant.
  // Cost: some 20 ms for each different rough or coated material, 80 ms for a coated conductor, and
  // 20 times that where the roughness is textured.
  static absl::StatusOr<std::unique_ptr<MaterialTable>> Build(const SceneDescription& scene,
                                                              FileSource& files,
                                                              const MaterialOptions& options);
  ~MaterialTable();

  // The Bsdf of a material at a point; kNone is an interface. Mixes are decided by u_mix (consumed
  // down the tree without losing uniformity). In a variant without kTextures materials must not
  // vary, in one without kAlpha there must be no mixes: the plan sees to both. Rows the Bsdf points
  // to live as long as *this. Thread safety: any number of threads at once. Compiled for every
  // variant of variant_list.h.
  template <uint32_t kTraits>
  BsdfOf<ColorOf<kTraits>> Evaluate(int32_t material, const TexturePoint& point, float u_mix,
                                    const WavelengthsOf<ColorOf<kTraits>>& wavelengths = {}) const;
  // plane.n as turned by the normal map or bump map of the material that Evaluate would choose;
  // unit length, on either side of the surface. Heights are in the unit of dpdu. A map's red runs
  // along dpdu, its green along dpdv made orthogonal, also where charts or instances are mirrored.
  Vec3f ShadingNormal(int32_t material, const TexturePoint& point, float u_mix,
                      const TangentPlane& plane) const;
  // The share of light that each scattering in the matter of a subsurface material keeps where
  // paths enter it, for matter whose reflectance is a texture. Requires: it is.
  Rgb MatterAlbedo(int32_t material, const TexturePoint& point, NoWavelengths wavelengths) const;
  Spectral MatterAlbedo(int32_t material, const TexturePoint& point,
                        const Wavelengths& wavelengths) const;
  // Value of a float input (cut-outs), as it is: a mask's author may have left [0, 1].
  template <uint32_t kTraits>
  float EvaluateFloat(const FloatInput& input, const TexturePoint& point) const;
  // Without texels, which the texture cache holds within a limit of its own.
  uint64_t memory_bytes() const;

  // Mixes of mixes may be nested this deep.
  static constexpr int kMixDepthMax = 64;

  struct Impl;

 private:
  MaterialTable();
  std::unique_ptr<Impl> impl_;
};

}  // namespace sheaf::render
