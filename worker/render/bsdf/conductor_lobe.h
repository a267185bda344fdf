// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Conductors: a mirror, or GGX with the energy of repeated reflection given back (energy_table.h).
// Directions come with wo.z > 0; bsdf_inl.h turns the other side over.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/lobe.h"
#include "worker/render/bsdf/microfacet.h"

namespace sheaf::render {

struct ConductorLobe : LobeBase {
  using Material = ConductorMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kConductor;
  static constexpr TraitBits kTraits = TraitSet(Trait::kMicrofacet);

  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool /*inside*/);

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                     float u_lobe, Vec2f u, bool inside);

  template <typename Color>
  static float PDF(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return f(bsdf, wo, wi, inside).pdf;
  }

 private:
  // How often the lobe of returned energy is sampled.
  template <typename Color>
  static float ReturnProbability(const BsdfOf<Color>& bsdf, float loss_o);
};

template <typename Color>
BsdfValueOf<Color> ConductorLobe::f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi,
                                    bool /*inside*/) {
  if (bsdf.specular || !(wi.z > 0)) return {};
  const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
  const Vec3f m = Normalize(wo + wi);
  const float d = ggx.D(m);
  const Color fresnel =
      FresnelConductor(std::min(1.0f, Dot(wo, m)), bsdf.conductor_eta, bsdf.conductor_k);
  BsdfValueOf<Color> value;
  value.f_cos = fresnel * (d * ggx.G2Over4Cos(wo, wi) * wi.z);
  value.pdf = 0.5f * d / (wo.z + ggx.S(wo));  // G1 D / (4 cos), finite at grazing wo.
  if (bsdf.conductor_energy == nullptr) return value;
  const BlendedLoss loss = LossOf(bsdf.conductor_energy, bsdf.blend);
  const float loss_o = loss.Loss(FindMu(wo.z));
  const MuPosition i = FindMu(wi.z);
  value.f_cos +=
      bsdf.color * (loss_o * loss.LossOverAverage(i) * wi.z * static_cast<float>(1 / kPi));
  const float probability = ReturnProbability(bsdf, loss_o);
  value.pdf = (1 - probability) * value.pdf + probability * loss.Pdf(i, wi.z);
  return value;
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> ConductorLobe::Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                           float u_lobe, Vec2f u, bool inside) {
  if (bsdf.specular) {
    return BsdfSampleOf<Color>{
        .wi = {-wo.x, -wo.y, wo.z},
        .weight = FresnelConductor(wo.z, bsdf.conductor_eta, bsdf.conductor_k),
        .flags = kBsdfSpecular};
  }
  if (bsdf.conductor_energy != nullptr) {
    const BlendedLoss loss = LossOf(bsdf.conductor_energy, bsdf.blend);
    const float probability = ReturnProbability(bsdf, loss.Loss(FindMu(wo.z)));
    if (u_lobe < probability) {
      const Vec3f wi = loss.Sample(u_lobe / probability, u);
      return FinishSample(f(bsdf, wo, wi, inside), wi, 0);
    }
  }
  const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
  const Vec3f wi = Reflect(wo, ggx.SampleVisibleNormal(wo, u));
  return FinishSample(f(bsdf, wo, wi, inside), wi, 0);
}

template <typename Color>
float ConductorLobe::ReturnProbability(const BsdfOf<Color>& bsdf, float loss_o) {
  return loss_o * MaxComponent(bsdf.color);
}

}  // namespace sheaf::render
