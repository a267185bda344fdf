// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lambertian reflection. Directions come with wo.z > 0.
#pragma once

#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/lobe.h"

namespace sheaf::render {

struct DiffuseLobe : LobeBase {
  using Material = DiffuseMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kDiffuse;

  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f /*wo*/, Vec3f wi, bool /*inside*/);

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f /*wo*/,
                                                     float /*u_lobe*/, Vec2f u, bool /*inside*/);

  template <typename Color>
  static float PDF(const BsdfOf<Color>&, Vec3f /*wo*/, Vec3f wi, bool /*inside*/) {
    return wi.z > 0 ? wi.z * static_cast<float>(1 / kPi) : 0;
  }
};

template <typename Color>
BsdfValueOf<Color> DiffuseLobe::f(const BsdfOf<Color>& bsdf, Vec3f /*wo*/, Vec3f wi,
                                  bool /*inside*/) {
  if (!(wi.z > 0)) return {};
  const float pdf = wi.z * static_cast<float>(1 / kPi);
  return {bsdf.color * pdf, pdf};
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> DiffuseLobe::Sample_f(const BsdfOf<Color>& bsdf, Vec3f /*wo*/,
                                                         float /*u_lobe*/, Vec2f u,
                                                         bool /*inside*/) {
  if (bsdf.color.IsBlack()) return std::nullopt;
  const Vec3f wi = SampleCosineHemisphere(u);
  return BsdfSampleOf<Color>{.wi = wi,
                             .weight = bsdf.color,
                             .pdf = wi.z * static_cast<float>(1 / kPi),
                             .flags = kBsdfDiffuse};
}

}  // namespace sheaf::render
