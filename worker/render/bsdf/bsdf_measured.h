// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Measured reflection as a Bsdf. Directions come with wo on the +z side; a surface that was turned
// over shows the same material, turned by half a circle about its normal as in pbrt-v4.
#pragma once

#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/measured_brdf.h"

namespace sheaf::render {

inline Vec3f TurnHalf(Vec3f w) { return {-w.x, -w.y, w.z}; }

template <typename Color>
BsdfValueOf<Color> EvalMeasured(const BsdfOf<Color>& bsdf, bool inside, Vec3f wo, Vec3f wi) {
  if (!(wi.z > 0)) return {};
  if (inside) {
    wo = TurnHalf(wo);
    wi = TurnHalf(wi);
  }
  const auto value = bsdf.measured->Eval(wo, wi, bsdf.conductor_eta);
  return {value.f_cos, value.pdf};
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> SampleMeasured(const BsdfOf<Color>& bsdf, bool inside, Vec3f wo,
                                                  Vec2f u) {
  std::optional<Vec3f> wi = bsdf.measured->Sample(inside ? TurnHalf(wo) : wo, u);
  if (!wi) return std::nullopt;
  if (inside) wi = TurnHalf(*wi);
  return FinishSample(EvalMeasured(bsdf, inside, wo, *wi), *wi, 0);
}

}  // namespace sheaf::render
