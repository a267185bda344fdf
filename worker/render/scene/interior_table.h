// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// InteriorTable: interiors that may overlap, in the order in which they displace each other. A
// closed shape whose material has a priority has an interior; where several overlap, only the one
// of the highest rank exists, and the boundaries of the others do not. Ranks are ordered by
// priority, then by index of refraction; interiors with the same properties share a rank, so that
// their shapes form one body, their union. Source: Schmidt and Budge 2002, "Simple Nested
// Dielectrics in Ray Traced Images". See docs/adr/0023.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"
#include "worker/render/accel/embree_scene.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/material/material.h"
#include "worker/render/medium/medium.h"
#include "worker/render/medium/medium_set.h"

namespace sheaf::render {

class InteriorTable {
 public:
  // Assigns a rank to each surface of geometry whose material has a priority. media: null where the
  // scene has none. Errors: kResourceExhausted over kMediaMax kinds of interiors; kInvalidArgument,
  // with the location of the shape, for a shape with a priority that has no inside.
  static absl::StatusOr<std::unique_ptr<InteriorTable>> Build(const SceneDescription& scene,
                                                              const MediumTable* media,
                                                              const MaterialTable& materials,
                                                              bool spectral, bool single_scattering,
                                                              SceneGeometry* geometry);
  // Finds the interiors that contain the camera, by the boundaries that a ray from there crosses;
  // of three rays, takes the result that two agree on. Space: render.
  void FindEnclosing(const SceneGeometry& geometry, const EmbreeScene& tracer, Vec3f camera_o);

  // The multiset of ranks of the shapes that contain the camera.
  const MediumSet& camera_interiors() const { return camera_interiors_; }
  // Index of the medium in the interiors of this rank, or kNone.
  int32_t MediumOf(uint16_t rank) const { return interiors_[rank].medium; }

  // Adapts bsdf, at a boundary of `rank`, to an interior of rank `other` (kNoRank: none) on its
  // outer side. Returns false if the boundary is invisible, because both indices are equal.
  template <typename Color>
  bool SetOutside(const Surface& surface, uint16_t other, const WavelengthsOf<Color>& wavelengths,
                  BsdfOf<Color>* bsdf) const;

 private:
  struct Interior {
    float eta = 1;
    bool disperses = false;
    SpectralColor index;
    int32_t medium = kNone;
  };
  template <typename Color>
  static float IndexOf(const Interior& interior, const WavelengthsOf<Color>& wavelengths) {
    if constexpr (std::is_same_v<Color, Spectral>) {
      if (interior.disperses) return interior.index.At(wavelengths.hero_nm());
    }
    return interior.eta;
  }
  void MakeRows(const SceneDescription& scene, const MaterialTable& materials);

  std::vector<Interior> interiors_;  // By rank.
  MediumSet camera_interiors_;
  // Energy loss of rough boundaries, by material and the rank outside.
  std::map<std::pair<int32_t, uint16_t>, DielectricEnergyRow> rows_;
};

// The highest rank of a set.
inline uint16_t TopOf(const MediumSet& interiors) {
  return interiors.empty() ? kNoRank : *(interiors.end() - 1);
}

template <typename Color>
bool InteriorTable::SetOutside(const Surface& surface, uint16_t other,
                               const WavelengthsOf<Color>& wavelengths, BsdfOf<Color>* bsdf) const {
  // Relative indices closer to 1 are treated as specular, as in MaterialTable.
  constexpr float kIndexDifferenceMin = 1e-4f;
  const Interior& inside = interiors_[surface.rank];
  float outside_eta = 1;
  if (other != kNoRank) {
    const Interior& outside = interiors_[other];
    outside_eta = IndexOf<Color>(outside, wavelengths);
    bsdf->disperses = bsdf->disperses || (std::is_same_v<Color, Spectral> && outside.disperses);
    const auto row = rows_.find({surface.material, other});
    bsdf->dielectric_energy = row == rows_.end() ? nullptr : &row->second;
    bsdf->blend = 0;
  }
  bsdf->eta = IndexOf<Color>(inside, wavelengths) / outside_eta;
  bsdf->specular = Ggx{bsdf->alpha_x, bsdf->alpha_y}.IsSmooth() ||
                   std::fabs(bsdf->eta - 1) < kIndexDifferenceMin;
  return bsdf->eta != 1;
}

}  // namespace sheaf::render
