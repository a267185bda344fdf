// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MaterialTable: the scene's materials and textures, ready for evaluation at hits. A constant
// material is a Bsdf that is made once, tables included; only varying inputs cost time at a hit.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/math/frame.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/geometry/tangent_plane.h"

namespace sheaf::render {

// The inputs of a texture lookup at a hit.
struct TexturePoint {
  Vec2f uv;
  Vec3d p_world;     // World space (not camera-relative), for 3-D and projected mappings.
  Vec2d uv_shift{};  // Added to uv, whose last digit may be larger.
  VertexColor color{1, 1, 1, 1};
  Vec3f ng{};  // Unit geometric normal in world space, of either sign; 0 where there is no surface.
};

// From where the coat of a surface is seen.
struct CoatView {
  const Frame& shading;  // The frame of the layer that the coat covers.
  Vec3f ng, wo;          // Unit: the geometric normal, and where light goes; in the frame's space.
};

struct MaterialOptions {
  uint64_t texture_cache_bytes_max = 0;  // As for TextureCache.
  bool spectral = false;                 // Evaluate may be called with kSpectral, too.
  bool single_scattering = false;        // As in RenderSettings.
};

class MaterialTable {
 public:
  // Errors: a texture that cannot be opened or decoded, named with its location; values outside
  // their range. Reflectance outside [0, 1] is clamped, with a warning if it is constant. Cost:
  // some 20 ms for each different rough or coated material, 80 ms for a coated conductor, and 20
  // times that for textured roughness.
  static absl::StatusOr<std::unique_ptr<MaterialTable>> Build(const SceneDescription& scene,
                                                              FileSource& files,
                                                              const MaterialOptions& options);
  ~MaterialTable();

  // Returns the Bsdf of a material at a point; kNone is an interface. u_mix decides mixes (it is
  // rescaled at each level, which keeps it uniform). In a variant without kTextures materials must
  // be constant, and without kAlpha there must be no mixes: the plan ensures both. Rows that the
  // Bsdf points to live as long as *this. Thread safety: any number of threads at once.
  // Instantiated for every variant of variant_list.h.
  template <TraitBits kTraits>
  BsdfOf<ColorOf<kTraits>> Evaluate(int32_t material, const TexturePoint& point, float u_mix,
                                    const WavelengthsOf<ColorOf<kTraits>>& wavelengths = {}) const;
  // Returns plane.n perturbed by the normal or bump map of the material that Evaluate would choose;
  // unit length, on either side of the surface. Heights are in the unit of dpdu. A normal map's red
  // channel is along dpdu, its green along the orthogonalized dpdv, also where charts or instances
  // are mirrored.
  Vec3f ShadingNormal(int32_t material, const TexturePoint& point, float u_mix,
                      const TangentPlane& plane) const;
  // Likewise the normal of a principled material's coat, if it has normals of its own.
  std::optional<Vec3f> CoatNormal(int32_t material, const TexturePoint& point, float u_mix,
                                  const TangentPlane& plane) const;
  // Sets coat_tilt of a principled Bsdf by CoatNormal, bent so that what wo sees of the coat is
  // above the surface.
  void TiltCoat(int32_t material, const TexturePoint& point, float u_mix, const TangentPlane& plane,
                const CoatView& view, BsdfShape* bsdf) const;
  // The single-scattering albedo of a subsurface medium at the point where a path enters, for a
  // reflectance that is a texture. Requires: it is.
  Rgb SubsurfaceAlbedo(int32_t material, const TexturePoint& point,
                       NoWavelengths wavelengths) const;
  Spectral SubsurfaceAlbedo(int32_t material, const TexturePoint& point,
                            const Wavelengths& wavelengths) const;
  // Value of a float input (cut-outs), unclamped: a mask may exceed [0, 1].
  template <TraitBits kTraits>
  float EvaluateFloat(const FloatInput& input, const TexturePoint& point) const;
  // Without texels, which the texture cache limits separately.
  uint64_t memory_bytes() const;
  uint64_t texture_bytes() const;  // The texels that are in memory now.

  // Maximum nesting depth of mixes.
  static constexpr int kMixDepthMax = 64;

  struct Impl;

 private:
  MaterialTable();
  std::unique_ptr<Impl> impl_;
};

}  // namespace sheaf::render
