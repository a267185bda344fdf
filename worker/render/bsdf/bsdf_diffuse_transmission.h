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

namespace sheaf::render {

// How often reflection is sampled. Requires: not both shares are black.
template <typename Color>
float SheetReflectProbability(const BsdfOf<Color>& bsdf) {
  const float reflect = MaxComponent(bsdf.color), transmit = MaxComponent(bsdf.conductor_eta);
  return reflect / (reflect + transmit);
}

template <typename Color>
BsdfValueOf<Color> EvalDiffuseTransmission(const BsdfOf<Color>& bsdf, Vec3f wi) {
  if (bsdf.color.IsBlack() && bsdf.conductor_eta.IsBlack()) return {};
  const float cos_over_pi = std::fabs(wi.z) * static_cast<float>(1 / kPi);
  const float reflect = SheetReflectProbability(bsdf);
  if (wi.z > 0) return {bsdf.color * cos_over_pi, reflect * cos_over_pi};
  return {bsdf.conductor_eta * cos_over_pi, (1 - reflect) * cos_over_pi};
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> SampleDiffuseTransmission(const BsdfOf<Color>& bsdf,
                                                             float u_lobe, Vec2f u) {
  if (bsdf.color.IsBlack() && bsdf.conductor_eta.IsBlack()) return std::nullopt;
  Vec3f wi = SampleCosineHemisphere(u);
  uint8_t flags = kBsdfDiffuse;
  if (u_lobe >= SheetReflectProbability(bsdf)) {
    wi.z = -wi.z;
    flags |= kBsdfTransmission;
  }
  return FinishSample(EvalDiffuseTransmission(bsdf, wi), wi, flags);
}

}  // namespace sheaf::render
