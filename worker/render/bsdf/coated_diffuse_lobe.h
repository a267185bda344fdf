// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A Lambertian base under a clear coat (coat_table.h): the interface's reflection, a delta lobe or
// GGX, and what comes back from the base. Directions come with wo.z > 0.
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

struct CoatedDiffuseLobe : LobeBase {
  using Material = CoatedDiffuseMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kCoatedDiffuse;
  static constexpr TraitBits kTraits = TraitSet(Trait::kLayered);

  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool /*inside*/);

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                     float u_lobe, Vec2f u, bool /*inside*/);

  template <typename Color>
  static float PDF(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return f(bsdf, wo, wi, inside).pdf;
  }

 private:
  // The coat's table at one alpha and one wo.
  template <typename Color>
  struct CoatAt {
    float enter_o = 0;    // T(wo).
    Color base;           // rho / (eta^2 (1 - rho K)).
    float p_reflect = 0;  // How often the interface's own reflection is sampled.
  };

  static float EnterAt(const BsdfShape& bsdf, MuPosition p) {
    const float first = bsdf.coat[0].enter.At(p);
    return bsdf.blend > 0 ? first + bsdf.blend * (bsdf.coat[1].enter.At(p) - first) : first;
  }

  template <typename Color>
  static CoatAt<Color> MakeCoatAt(const BsdfOf<Color>& bsdf, float mu_o);

  template <typename Color>
  static BsdfValueOf<Color> EvalAt(const BsdfOf<Color>& bsdf, const CoatAt<Color>& at, Vec3f wo,
                                   Vec3f wi);
};

template <typename Color>
BsdfValueOf<Color> CoatedDiffuseLobe::f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi,
                                        bool /*inside*/) {
  return EvalAt(bsdf, MakeCoatAt(bsdf, wo.z), wo, wi);
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> CoatedDiffuseLobe::Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                               float u_lobe, Vec2f u,
                                                               bool /*inside*/) {
  const CoatAt<Color> at = MakeCoatAt(bsdf, wo.z);
  const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
  if (u_lobe >= at.p_reflect) {
    const Vec3f wi = SampleCosineHemisphere(u);
    return FinishSample(EvalAt(bsdf, at, wo, wi), wi, kBsdfDiffuse);
  }
  if (ggx.IsSmooth()) {
    const float reflectance = FresnelDielectric(wo.z, bsdf.eta).reflectance;
    return BsdfSampleOf<Color>{.wi = {-wo.x, -wo.y, wo.z},
                               .weight = Color::Gray(reflectance / at.p_reflect),
                               .flags = kBsdfSpecular};
  }
  const Vec3f wi = Reflect(wo, ggx.SampleVisibleNormal(wo, u));
  return FinishSample(EvalAt(bsdf, at, wo, wi), wi, 0);
}

template <typename Color>
CoatedDiffuseLobe::CoatAt<Color> CoatedDiffuseLobe::MakeCoatAt(const BsdfOf<Color>& bsdf,
                                                               float mu_o) {
  const MuPosition o = FindMu(mu_o);
  float reflect = bsdf.coat[0].reflect.At(o);
  float recapture = bsdf.coat[0].recapture, enter_average = bsdf.coat[0].enter_average;
  if (bsdf.blend > 0) {
    reflect += bsdf.blend * (bsdf.coat[1].reflect.At(o) - reflect);
    recapture += bsdf.blend * (bsdf.coat[1].recapture - recapture);
    enter_average += bsdf.blend * (bsdf.coat[1].enter_average - enter_average);
  }
  CoatAt<Color> at;
  at.enter_o = EnterAt(bsdf, o);
  const float eta2 = bsdf.eta * bsdf.eta;
  at.base = MakeColor<Color>(
      [&](size_t c) { return bsdf.color[c] / (eta2 * (1 - bsdf.color[c] * recapture)); });
  const float from_base = at.enter_o * enter_average * MaxComponent(at.base);
  at.p_reflect = reflect > 0 ? reflect / (reflect + from_base) : 0;
  return at;
}

template <typename Color>
BsdfValueOf<Color> CoatedDiffuseLobe::EvalAt(const BsdfOf<Color>& bsdf, const CoatAt<Color>& at,
                                             Vec3f wo, Vec3f wi) {
  if (!(wi.z > 0)) return {};
  const float cos_over_pi = wi.z * static_cast<float>(1 / kPi);
  BsdfValueOf<Color> value;
  value.f_cos = at.base * (at.enter_o * EnterAt(bsdf, FindMu(wi.z)) * cos_over_pi);
  value.pdf = (1 - at.p_reflect) * cos_over_pi;
  const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
  if (ggx.IsSmooth()) return value;
  const Vec3f m = Normalize(wo + wi);
  const float d = ggx.D(m);
  const float fresnel = FresnelDielectric(std::min(1.0f, Dot(wo, m)), bsdf.eta).reflectance;
  value.f_cos += Color::Gray(fresnel * d * ggx.G2Over4Cos(wo, wi) * wi.z);
  value.pdf += at.p_reflect * 0.5f * d / (wo.z + ggx.S(wo));
  return value;
}

}  // namespace sheaf::render
