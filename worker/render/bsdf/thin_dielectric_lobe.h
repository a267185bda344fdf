// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Thin slabs of a dielectric, such as window panes. Directions come with wo.z > 0.
#pragma once

#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/lobe.h"

namespace sheaf::render {

// A slab much thinner than anything around it: all orders of reflection between its two faces add
// up to R' = R + T^2 R / (1 - R^2) = 2 R / (1 + R), and what crosses goes straight on.
struct ThinDielectricLobe : LobeBase {
  using Material = ThinDielectricMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kThinDielectric;
  static constexpr TraitBits kTraits = TraitSet(Trait::kSpecularTransmission);
  static constexpr bool kTransmits = true;

  // A delta lobe: f and PDF are 0.
  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>&, Vec3f /*wo*/, Vec3f /*wi*/, bool /*inside*/) {
    return {};
  }

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                     float u_lobe, Vec2f /*u*/, bool /*inside*/);

  template <typename Color>
  static float PDF(const BsdfOf<Color>&, Vec3f /*wo*/, Vec3f /*wi*/, bool /*inside*/) {
    return 0;
  }
};

template <typename Color>
std::optional<BsdfSampleOf<Color>> ThinDielectricLobe::Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                                float u_lobe, Vec2f /*u*/,
                                                                bool /*inside*/) {
  const float once = FresnelDielectric(wo.z, bsdf.eta).reflectance;
  const float reflectance = 2 * once / (1 + once);
  if (u_lobe < reflectance) {
    return BsdfSampleOf<Color>{
        .wi = {-wo.x, -wo.y, wo.z}, .weight = Color::Gray(1), .flags = kBsdfSpecular};
  }
  return BsdfSampleOf<Color>{
      .wi = -wo, .weight = Color::Gray(1), .flags = kBsdfSpecular | kBsdfTransmission};
}

}  // namespace sheaf::render
