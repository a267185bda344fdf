// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Thin diffuse sheets, such as leaves, paper and cloth: Lambertian reflection and, with a share of
// its own, Lambertian transmission. Directions come with wo on the +z side.
#pragma once

#include <cmath>
#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/lobe.h"

namespace sheaf::render {

struct DiffuseTransmissionLobe : LobeBase {
  using Material = DiffuseTransmissionMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kDiffuseTransmission;
  static constexpr TraitBits kTraits = TraitSet(Trait::kSpecularTransmission);
  static constexpr bool kTransmits = true;

  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f /*wo*/, Vec3f wi, bool /*inside*/);

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                     float u_lobe, Vec2f u, bool inside);

  template <typename Color>
  static float PDF(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return f(bsdf, wo, wi, inside).pdf;
  }

 private:
  // How often reflection is sampled. Requires: not both shares are black.
  template <typename Color>
  static float ReflectProbability(const BsdfOf<Color>& bsdf);
};

template <typename Color>
BsdfValueOf<Color> DiffuseTransmissionLobe::f(const BsdfOf<Color>& bsdf, Vec3f /*wo*/, Vec3f wi,
                                              bool /*inside*/) {
  if (bsdf.color.IsBlack() && bsdf.conductor_eta.IsBlack()) return {};
  const float cos_over_pi = std::fabs(wi.z) * static_cast<float>(1 / kPi);
  const float reflect = ReflectProbability(bsdf);
  if (wi.z > 0) return {bsdf.color * cos_over_pi, reflect * cos_over_pi};
  return {bsdf.conductor_eta * cos_over_pi, (1 - reflect) * cos_over_pi};
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> DiffuseTransmissionLobe::Sample_f(const BsdfOf<Color>& bsdf,
                                                                     Vec3f wo, float u_lobe,
                                                                     Vec2f u, bool inside) {
  if (bsdf.color.IsBlack() && bsdf.conductor_eta.IsBlack()) return std::nullopt;
  Vec3f wi = SampleCosineHemisphere(u);
  uint8_t flags = kBsdfDiffuse;
  if (u_lobe >= ReflectProbability(bsdf)) {
    wi.z = -wi.z;
    flags |= kBsdfTransmission;
  }
  return FinishSample(f(bsdf, wo, wi, inside), wi, flags);
}

template <typename Color>
float DiffuseTransmissionLobe::ReflectProbability(const BsdfOf<Color>& bsdf) {
  const float reflect = MaxComponent(bsdf.color), transmit = MaxComponent(bsdf.conductor_eta);
  return reflect / (reflect + transmit);
}

}  // namespace sheaf::render
