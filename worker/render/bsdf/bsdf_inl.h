// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SampleBsdf and EvalBsdf: the choice among the kinds of scattering. Include this where the
// integrator is compiled for one set of traits: kinds the set does not hold vanish from it.
#pragma once

#include <cmath>
#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_coat.h"
#include "worker/render/bsdf/bsdf_conductor.h"
#include "worker/render/bsdf/bsdf_conductor_coat.h"
#include "worker/render/bsdf/bsdf_dielectric.h"
#include "worker/render/bsdf/bsdf_diffuse_transmission.h"
#include "worker/render/bsdf/bsdf_hair.h"
#include "worker/render/bsdf/bsdf_measured.h"
#include "worker/render/bsdf/bsdf_sampling.h"

namespace sheaf::render {

inline Vec3f FlipZ(Vec3f w) { return {w.x, w.y, -w.z}; }

// For wo.z > 0. inside: the surface was turned over, wo is on its -z side.
template <uint32_t kTraits, typename Color>
BsdfValueOf<Color> EvalUpper(const BsdfOf<Color>& bsdf, bool inside, Vec3f wo, Vec3f wi) {
  switch (bsdf.kind) {
    case BsdfKind::kDiffuse: {
      if (!(wi.z > 0)) return {};
      const float pdf = wi.z * static_cast<float>(1 / kPi);
      return {bsdf.color * pdf, pdf};
    }
    case BsdfKind::kConductor:
      if constexpr (Has(kTraits, Trait::kMicrofacet)) return EvalConductor(bsdf, wo, wi);
      return {};
    case BsdfKind::kDielectric:
      if constexpr (Has(kTraits, Trait::kSpecularTransmission)) {
        return EvalDielectric<Color>(bsdf, {inside ? 1 / bsdf.eta : bsdf.eta, inside}, wo, wi);
      }
      return {};
    case BsdfKind::kDiffuseTransmission:
      if constexpr (Has(kTraits, Trait::kSpecularTransmission)) {
        return EvalDiffuseTransmission(bsdf, wi);
      }
      return {};
    case BsdfKind::kCoatedDiffuse:
      if constexpr (Has(kTraits, Trait::kLayered)) return EvalCoat(bsdf, wo, wi);
      return {};
    case BsdfKind::kCoatedConductor:
      if constexpr (Has(kTraits, Trait::kLayered)) return EvalConductorCoat(bsdf, wo, wi);
      return {};
    case BsdfKind::kMeasured:
      if constexpr (Has(kTraits, Trait::kMeasured)) return EvalMeasured(bsdf, inside, wo, wi);
      return {};
    case BsdfKind::kBlack:
    case BsdfKind::kThinDielectric:
    case BsdfKind::kHair:
    case BsdfKind::kInterface:
      return {};
  }
  return {};
}

template <uint32_t kTraits, typename Color>
std::optional<BsdfSampleOf<Color>> SampleUpper(const BsdfOf<Color>& bsdf, bool inside, Vec3f wo,
                                               float u_lobe, Vec2f u) {
  switch (bsdf.kind) {
    case BsdfKind::kDiffuse: {
      if (bsdf.color.IsBlack()) return std::nullopt;
      const Vec3f wi = SampleCosineHemisphere(u);
      return BsdfSampleOf<Color>{.wi = wi,
                                 .weight = bsdf.color,
                                 .pdf = wi.z * static_cast<float>(1 / kPi),
                                 .flags = kBsdfDiffuse};
    }
    case BsdfKind::kConductor:
      if constexpr (Has(kTraits, Trait::kMicrofacet)) return SampleConductor(bsdf, wo, u_lobe, u);
      return std::nullopt;
    case BsdfKind::kDielectric:
      if constexpr (Has(kTraits, Trait::kSpecularTransmission)) {
        return SampleDielectric<Color>(bsdf, {inside ? 1 / bsdf.eta : bsdf.eta, inside}, wo, u_lobe,
                                       u);
      }
      return std::nullopt;
    case BsdfKind::kThinDielectric:
      if constexpr (Has(kTraits, Trait::kSpecularTransmission)) {
        return SampleThinDielectric<Color>(bsdf.eta, wo, u_lobe);
      }
      return std::nullopt;
    case BsdfKind::kDiffuseTransmission:
      if constexpr (Has(kTraits, Trait::kSpecularTransmission)) {
        return SampleDiffuseTransmission(bsdf, u_lobe, u);
      }
      return std::nullopt;
    case BsdfKind::kCoatedDiffuse:
      if constexpr (Has(kTraits, Trait::kLayered)) return SampleCoat(bsdf, wo, u_lobe, u);
      return std::nullopt;
    case BsdfKind::kCoatedConductor:
      if constexpr (Has(kTraits, Trait::kLayered)) {
        return SampleConductorCoat(bsdf, wo, u_lobe, u);
      }
      return std::nullopt;
    case BsdfKind::kInterface:
      if constexpr (Has(kTraits, Trait::kAlpha)) {
        return BsdfSampleOf<Color>{
            .wi = -wo, .weight = Color::Grey(1), .flags = kBsdfSpecular | kBsdfTransmission};
      }
      return std::nullopt;
    case BsdfKind::kMeasured:
      if constexpr (Has(kTraits, Trait::kMeasured)) return SampleMeasured(bsdf, inside, wo, u);
      return std::nullopt;
    case BsdfKind::kBlack:
    case BsdfKind::kHair:
      return std::nullopt;
  }
  return std::nullopt;
}

template <uint32_t kTraits, typename Color>
BsdfValueOf<Color> EvalBsdf(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi) {
  if (IsHair<kTraits>(bsdf)) return EvalHair(bsdf, wo, wi);
  if (wo.z > 0) return EvalUpper<kTraits>(bsdf, false, wo, wi);
  if (wo.z < 0) return EvalUpper<kTraits>(bsdf, true, FlipZ(wo), FlipZ(wi));
  return {};
}

template <uint32_t kTraits, typename Color>
std::optional<BsdfSampleOf<Color>> SampleBsdf(const BsdfOf<Color>& bsdf, Vec3f wo, float u_lobe,
                                              Vec2f u) {
  if (IsHair<kTraits>(bsdf)) return SampleHair(bsdf, wo, u_lobe, u);
  if (wo.z > 0) return SampleUpper<kTraits>(bsdf, false, wo, u_lobe, u);
  if (!(wo.z < 0)) return std::nullopt;
  std::optional<BsdfSampleOf<Color>> sample =
      SampleUpper<kTraits>(bsdf, true, FlipZ(wo), u_lobe, u);
  if (sample) sample->wi = FlipZ(sample->wi);
  return sample;
}

}  // namespace sheaf::render
