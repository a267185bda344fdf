// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Measured reflection as a Bsdf. Directions come with wo on the +z side; a surface that was turned
// over shows the same material, turned by half a circle about its normal as in pbrt-v4.
#pragma once

#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/lobe.h"
#include "worker/render/bsdf/measured_brdf.h"

namespace sheaf::render {

struct MeasuredLobe : LobeBase {
  using Material = MeasuredMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kMeasured;
  static constexpr TraitBits kTraits = TraitSet(Trait::kMeasured);

  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside);

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                     float /*u_lobe*/, Vec2f u, bool inside);

  template <typename Color>
  static float PDF(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return f(bsdf, wo, wi, inside).pdf;
  }

 private:
  static Vec3f TurnHalf(Vec3f w) { return {-w.x, -w.y, w.z}; }
};

template <typename Color>
BsdfValueOf<Color> MeasuredLobe::f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
  if (!(wi.z > 0)) return {};
  if (inside) {
    wo = TurnHalf(wo);
    wi = TurnHalf(wi);
  }
  const auto value = bsdf.measured->Eval(wo, wi, bsdf.conductor_eta);
  return {value.f_cos, value.pdf};
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> MeasuredLobe::Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                          float /*u_lobe*/, Vec2f u, bool inside) {
  std::optional<Vec3f> wi = bsdf.measured->Sample(inside ? TurnHalf(wo) : wo, u);
  if (!wi) return std::nullopt;
  if (inside) wi = TurnHalf(*wi);
  return FinishSample(f(bsdf, wo, *wi, inside), *wi, 0);
}

}  // namespace sheaf::render
