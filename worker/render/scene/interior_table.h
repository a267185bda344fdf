// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// InteriorTable: matter that may overlap, in the order in which it displaces other matter. Closed
// shapes whose material has a priority are filled with matter; where several overlap, the one of
// the highest rank is there and the others are not, nor are their boundaries. Ranks go by priority,
// then by index of refraction: what is the same in all has one rank, so that shapes of the same
// matter are one body, their union. Source: Schmidt and Budge 2002, "Simple Nested Dielectrics in
// Ray Traced Images". See docs/adr/0023.
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
  // Gives each surface of geometry whose material has a priority its rank. media: null where the
  // scene has none. Errors: kResourceExhausted over kMediaMax kinds of matter; kInvalidArgument
  // with the location of a shape with a priority that has no inside.
  static absl::StatusOr<std::unique_ptr<InteriorTable>> Build(const SceneDescription& scene,
                                                              const MediumTable* media,
                                                              const MaterialTable& materials,
                                                              bool spectral, bool single_scattering,
                                                              SceneGeometry* geometry);
  // Finds out what matter a point is in: by the boundaries that a ray from there meets, of three
  // rays what two agree on. Space: render.
  void LookAround(const SceneGeometry& geometry, const EmbreeScene& tracer, Vec3f camera_o);

  // Ranks, each as often as the camera is inside of a shape of it.
  const MediumSet& camera_interiors() const { return camera_interiors_; }
  // Index of the medium that is part of matter of this rank, or kNone.
  int32_t MediumOf(uint16_t rank) const { return matter_[rank].medium; }

  // Makes bsdf, that of a boundary of `rank`, one against matter of rank `other` (kNoRank: none)
  // on its outer side. False where there is nothing to be seen, for both have the same index.
  template <typename Color>
  bool SetOutside(const Surface& surface, uint16_t other, const WavelengthsOf<Color>& wavelengths,
                  BsdfOf<Color>* bsdf) const;

 private:
  struct Matter {
    float eta = 1;
    bool disperses = false;
    SpectralColor index;
    int32_t medium = kNone;
  };
  template <typename Color>
  static float IndexOf(const Matter& matter, const WavelengthsOf<Color>& wavelengths) {
    if constexpr (std::is_same_v<Color, Spectral>) {
      if (matter.disperses) return matter.index.At(wavelengths.hero_nm());
    }
    return matter.eta;
  }
  void MakeRows(const SceneDescription& scene, const MaterialTable& materials);

  std::vector<Matter> matter_;  // By rank.
  MediumSet camera_interiors_;
  // What rough boundaries lose, by material and the rank outside.
  std::map<std::pair<int32_t, uint16_t>, DielectricEnergyRow> rows_;
};

// The highest of a set.
inline uint16_t TopOf(const MediumSet& interiors) {
  return interiors.empty() ? kNoRank : *(interiors.end() - 1);
}

template <typename Color>
bool InteriorTable::SetOutside(const Surface& surface, uint16_t other,
                               const WavelengthsOf<Color>& wavelengths, BsdfOf<Color>* bsdf) const {
  // Closer to 1 than this no facet can be told: as MaterialTable has it.
  constexpr float kIndexDifferenceMin = 1e-4f;
  const Matter& inside = matter_[surface.rank];
  float outside_eta = 1;
  if (other != kNoRank) {
    const Matter& outside = matter_[other];
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
