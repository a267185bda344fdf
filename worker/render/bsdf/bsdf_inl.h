// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SampleBsdf, EvalBsdf and PdfBsdf: the choice among the lobes. Include this where the integrator
// is compiled for one set of traits: lobes the set does not hold vanish from it.
#pragma once

#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/lobes.h"

namespace sheaf::render {

inline Vec3f FlipZ(Vec3f w) { return {w.x, w.y, -w.z}; }

// For wo.z > 0. inside: the surface was turned over, wo is on its -z side.
template <TraitBits kTraits, typename Color>
BsdfValueOf<Color> EvalUpper(const BsdfOf<Color>& bsdf, bool inside, Vec3f wo, Vec3f wi) {
  return Lobes::Choose<kTraits, BsdfValueOf<Color>>(
      bsdf.kind, [&]<typename Lobe>(Lobe) __attribute__((always_inline))->BsdfValueOf<Color> {
        if constexpr (!Lobe::kHasSides) return {};
        return Lobe::f(bsdf, wo, wi, inside);
      });
}

template <TraitBits kTraits, typename Color>
std::optional<BsdfSampleOf<Color>> SampleUpper(const BsdfOf<Color>& bsdf, bool inside, Vec3f wo,
                                               float u_lobe, Vec2f u) {
  return Lobes::Choose<kTraits, std::optional<BsdfSampleOf<Color>>>(
      bsdf.kind, [&]<typename Lobe>(Lobe) __attribute__((always_inline))
                     ->std::optional<BsdfSampleOf<Color>> {
                       if constexpr (!Lobe::kHasSides) return std::nullopt;
                       return Lobe::Sample_f(bsdf, wo, u_lobe, u, inside);
                     });
}

template <TraitBits kTraits, typename Color>
float PdfUpper(const BsdfOf<Color>& bsdf, bool inside, Vec3f wo, Vec3f wi) {
  return Lobes::Choose<kTraits, float>(
      bsdf.kind, [&]<typename Lobe>(Lobe) __attribute__((always_inline))->float {
        if constexpr (!Lobe::kHasSides) return 0;
        return Lobe::PDF(bsdf, wo, wi, inside);
      });
}

template <TraitBits kTraits, typename Color>
BsdfValueOf<Color> EvalBsdf(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi) {
  if (IsHair<kTraits>(bsdf)) return HairLobe::f(bsdf, wo, wi, false);
  if (wo.z > 0) return EvalUpper<kTraits>(bsdf, false, wo, wi);
  if (wo.z < 0) return EvalUpper<kTraits>(bsdf, true, FlipZ(wo), FlipZ(wi));
  return {};
}

template <TraitBits kTraits, typename Color>
std::optional<BsdfSampleOf<Color>> SampleBsdf(const BsdfOf<Color>& bsdf, Vec3f wo, float u_lobe,
                                              Vec2f u) {
  if (IsHair<kTraits>(bsdf)) return HairLobe::Sample_f(bsdf, wo, u_lobe, u, false);
  if (wo.z > 0) return SampleUpper<kTraits>(bsdf, false, wo, u_lobe, u);
  if (!(wo.z < 0)) return std::nullopt;
  std::optional<BsdfSampleOf<Color>> sample =
      SampleUpper<kTraits>(bsdf, true, FlipZ(wo), u_lobe, u);
  if (sample) sample->wi = FlipZ(sample->wi);
  return sample;
}

// EvalBsdf's pdf alone, to the bit: over solid angle; 0 for delta lobes.
template <TraitBits kTraits, typename Color>
float PdfBsdf(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi) {
  if (IsHair<kTraits>(bsdf)) return HairLobe::PDF(bsdf, wo, wi, false);
  if (wo.z > 0) return PdfUpper<kTraits>(bsdf, false, wo, wi);
  if (wo.z < 0) return PdfUpper<kTraits>(bsdf, true, FlipZ(wo), FlipZ(wi));
  return 0;
}

// Whether light may arrive from behind the surface. False for interfaces, which rays pass.
template <TraitBits kTraits>
bool Transmits(const BsdfShape& bsdf) {
  return Lobes::Choose<kTraits, bool>(
      bsdf.kind, [&]<typename Lobe>(Lobe) { return Lobe::kTransmits && Lobe::MayCross(bsdf); });
}

}  // namespace sheaf::render
