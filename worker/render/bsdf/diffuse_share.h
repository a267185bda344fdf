// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DiffuseShare: the part of what a Bsdf scatters that is diffuse, for the kinds of rays.
#pragma once

#include <algorithm>

#include "worker/render/bsdf/bsdf_inl.h"

namespace sheaf::render {

// The fraction of f(wo, wi), by color, that diffuse lobes scatter: Lambertian ones and sheen. In
// [0, 1]; the rest is glossy. Requires: wi is on the side of wo.
template <TraitBits kTraits, typename Color>
Color DiffuseShare(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi) {
  const auto share_of = [](const Color& part, const Color& whole) {
    return MakeColor<Color>(
        [&](size_t c) { return whole[c] > 0 ? std::clamp(part[c] / whole[c], 0.0f, 1.0f) : 0; });
  };
  switch (bsdf.kind) {
    case BsdfKind::kDiffuse:
    case BsdfKind::kDiffuseTransmission:
      return Color::Gray(1);
    case BsdfKind::kCoatedDiffuse: {
      BsdfOf<Color> coat = bsdf;
      coat.color = {};
      const Color whole = EvalBsdf<kTraits>(bsdf, wo, wi).f_cos;
      const Color glossy = EvalBsdf<kTraits>(coat, wo, wi).f_cos;
      return share_of(MakeColor<Color>([&](size_t c) { return whole[c] - glossy[c]; }), whole);
    }
    case BsdfKind::kPrincipled: {
      if constexpr (Has(kTraits, Trait::kPrincipled)) {
        const bool inside = wo.z < 0;
        const Vec3f o = inside ? FlipZ(wo) : wo, i = inside ? FlipZ(wi) : wi;
        return share_of(PrincipledLobe::DiffusePart(bsdf, o, i, inside),
                        EvalBsdf<kTraits>(bsdf, wo, wi).f_cos);
      }
      return {};
    }
    default:
      return {};
  }
}

}  // namespace sheaf::render
