// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A conductor under a clear coat (conductor_coat_table.h): the interface's reflection, a delta lobe
// or GGX, the base's highlight, and the rest. Where both layers are mirrors all is one delta lobe,
// in closed form. Directions come with wo.z > 0. The
// Bsdf's alpha_x and alpha_y belong to the interface, conductor_eta and conductor_k are relative to
// the coat, and color is the tint of the rest.
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

struct CoatedConductorLobe : LobeBase {
  using Material = CoatedConductorMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kCoatedConductor;
  static constexpr TraitBits kTraits = TraitSet(Trait::kLayered);

  // f and Sample_f are not inlined: they are long, and would crowd the loops of scenes whose
  // layered surfaces are others.
  template <typename Color>
  [[gnu::noinline]] static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi,
                                                bool /*inside*/);

  template <typename Color>
  [[gnu::noinline]] static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf,
                                                                       Vec3f wo, float u_lobe,
                                                                       Vec2f u, bool /*inside*/);

  template <typename Color>
  static float PDF(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return f(bsdf, wo, wi, inside).pdf;
  }

 private:
  // The direction inside the coat, still on the upper side; z = 0 where there is none.
  static Vec3f IntoCoat(Vec3f w, float eta) {
    return {w.x / eta, w.y / eta, FresnelDielectric(w.z, eta).cos_t};
  }

  // The coat's tables at one wo.
  struct ConductorCoatAt {
    Vec3f inner_o;
    float enter_o = 0, reflect_o = 0, rest_o = 0;
    float bend_o = 0;
    Ggx lobe;  // By which the highlight is sampled: that of the mirror direction.
    float p_reflect = 0, p_highlight = 0, p_rest = 0;  // How often each part is sampled.
  };

  template <typename Color>
  static ConductorCoatAt MakeConductorCoatAt(const BsdfOf<Color>& bsdf, Vec3f wo);

  // Fraction of light left by the base and the way to it and back; cosines inside the coat.
  template <typename Color>
  static Color KeptByBase(const BsdfOf<Color>& bsdf, float cos_half, float cos_o, float cos_i);

  // kept / (1 - again kept), by component.
  template <typename Color>
  static Color ReflectedSeries(const Color& kept, float again);

  template <typename Color>
  static BsdfValueOf<Color> EvalAt(const BsdfOf<Color>& bsdf, const ConductorCoatAt& at, Vec3f wo,
                                   Vec3f wi);
  // Both layers mirrors: R + (1 - R)^2 K / (1 - R K), with K what one visit to the base leaves.
  template <typename Color>
  static BsdfSampleOf<Color> SampleMirrorCoat(const BsdfOf<Color>& bsdf, Vec3f wo);
};

template <typename Color>
BsdfValueOf<Color> CoatedConductorLobe::f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi,
                                          bool /*inside*/) {
  if (bsdf.specular) return {};
  return EvalAt(bsdf, MakeConductorCoatAt(bsdf, wo), wo, wi);
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> CoatedConductorLobe::Sample_f(const BsdfOf<Color>& bsdf,
                                                                 Vec3f wo, float u_lobe, Vec2f u,
                                                                 bool /*inside*/) {
  if (bsdf.specular) return SampleMirrorCoat(bsdf, wo);
  const ConductorCoatRow& row = *bsdf.conductor_coat;
  const ConductorCoatAt at = MakeConductorCoatAt(bsdf, wo);
  Vec3f wi;
  if (u_lobe < at.p_reflect) {
    const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
    if (ggx.IsSmooth()) {
      const float reflectance = FresnelDielectric(wo.z, bsdf.eta).reflectance;
      return BsdfSampleOf<Color>{.wi = {-wo.x, -wo.y, wo.z},
                                 .weight = Color::Gray(reflectance / at.p_reflect),
                                 .flags = kBsdfSpecular};
    }
    wi = Reflect(wo, ggx.SampleVisibleNormal(wo, u));
  } else if (u_lobe < at.p_reflect + at.p_highlight) {
    const Vec3f inner_i = Reflect(at.inner_o, at.lobe.SampleVisibleNormal(at.inner_o, u));
    if (!(inner_i.z > 0)) return std::nullopt;
    const float cos_i = FresnelDielectric(std::min(1.0f, inner_i.z), 1 / bsdf.eta).cos_t;
    if (!(cos_i > 0)) return std::nullopt;  // Totally reflected: that light is in the rest.
    wi = Normalize(Vec3f{inner_i.x * bsdf.eta, inner_i.y * bsdf.eta, cos_i});
  } else {
    wi = Reflect(wo, row.rest_lobe.SampleVisibleNormal(wo, u));
  }
  return FinishSample(EvalAt(bsdf, at, wo, wi), wi, 0);
}

template <typename Color>
CoatedConductorLobe::ConductorCoatAt CoatedConductorLobe::MakeConductorCoatAt(
    const BsdfOf<Color>& bsdf, Vec3f wo) {
  const ConductorCoatRow& row = *bsdf.conductor_coat;
  const MuPosition o = FindMu(wo.z);
  ConductorCoatAt at;
  at.inner_o = IntoCoat(wo, bsdf.eta);
  at.enter_o = row.enter.At(o);
  at.reflect_o = row.reflect.At(o);
  at.rest_o = row.rest.At(o);
  at.bend_o = row.bend.At(o);
  at.lobe = row.LobeAt(at.bend_o, at.bend_o);
  const float base = MaxComponent(
      FresnelConductor(std::min(1.0f, at.inner_o.z), bsdf.conductor_eta, bsdf.conductor_k));
  const float highlight = row.highlight.At(o) * base;
  const float rest = row.rest_albedo.At(o) * MaxComponent(bsdf.color);
  const float sum = at.reflect_o + highlight + rest;
  if (!(sum > 0)) return at;
  at.p_reflect = at.reflect_o / sum;
  at.p_highlight = highlight / sum;
  at.p_rest = rest / sum;
  return at;
}

template <typename Color>
Color CoatedConductorLobe::KeptByBase(const BsdfOf<Color>& bsdf, float cos_half, float cos_o,
                                      float cos_i) {
  const float thickness = bsdf.conductor_coat->thickness;
  return FresnelConductor(std::min(1.0f, cos_half), bsdf.conductor_eta, bsdf.conductor_k) *
         Exp(-thickness / cos_o - thickness / cos_i);
}

template <typename Color>
Color CoatedConductorLobe::ReflectedSeries(const Color& kept, float again) {
  return MakeColor<Color>(
      [&](size_t c) { return kept[c] / std::max(kSeriesMin, 1 - again * kept[c]); });
}

template <typename Color>
BsdfValueOf<Color> CoatedConductorLobe::EvalAt(const BsdfOf<Color>& bsdf, const ConductorCoatAt& at,
                                               Vec3f wo, Vec3f wi) {
  if (!(wi.z > 0)) return {};
  const ConductorCoatRow& row = *bsdf.conductor_coat;
  const MuPosition i = FindMu(wi.z);
  const Vec3f half = Normalize(wo + wi);
  const float rest_d = row.rest_lobe.D(half);
  BsdfValueOf<Color> value;
  value.f_cos =
      bsdf.color * (at.rest_o * row.rest.At(i) * rest_d * row.rest_lobe.G2Over4Cos(wo, wi) * wi.z);
  value.pdf = at.p_rest * 0.5f * rest_d / (wo.z + row.rest_lobe.S(wo));
  const Vec3f inner_i = IntoCoat(wi, bsdf.eta);
  if (at.inner_o.z > 0 && inner_i.z > 0) {
    const Vec3f m = Normalize(at.inner_o + inner_i);
    const Ggx lobe = row.LobeAt(at.bend_o, row.bend.At(i));
    // Solid angle inside over outside the coat.
    const float narrowing = wi.z / (bsdf.eta * bsdf.eta * inner_i.z);
    const Color series =
        ReflectedSeries(KeptByBase(bsdf, Dot(at.inner_o, m), at.inner_o.z, inner_i.z),
                        std::min(at.reflect_o, row.reflect.At(i)));
    value.f_cos += series * (at.enter_o * row.enter.At(i) * lobe.D(m) *
                             lobe.G2Over4Cos(at.inner_o, inner_i) * inner_i.z * narrowing);
    value.pdf +=
        at.p_highlight * 0.5f * at.lobe.D(m) / (at.inner_o.z + at.lobe.S(at.inner_o)) * narrowing;
  }
  const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
  if (ggx.IsSmooth()) return value;
  const float d = ggx.D(half);
  const float fresnel = FresnelDielectric(std::min(1.0f, Dot(wo, half)), bsdf.eta).reflectance;
  value.f_cos += Color::Gray(fresnel * d * ggx.G2Over4Cos(wo, wi) * wi.z);
  value.pdf += at.p_reflect * 0.5f * d / (wo.z + ggx.S(wo));
  return value;
}

template <typename Color>
BsdfSampleOf<Color> CoatedConductorLobe::SampleMirrorCoat(const BsdfOf<Color>& bsdf, Vec3f wo) {
  const DielectricFresnel fresnel = FresnelDielectric(wo.z, bsdf.eta);
  const float enters = 1 - fresnel.reflectance;
  Color weight = Color::Gray(fresnel.reflectance);
  if (fresnel.cos_t > 0) {
    weight += ReflectedSeries(KeptByBase(bsdf, fresnel.cos_t, fresnel.cos_t, fresnel.cos_t),
                              fresnel.reflectance) *
              (enters * enters);
  }
  return {.wi = {-wo.x, -wo.y, wo.z}, .weight = weight, .flags = kBsdfSpecular};
}

}  // namespace sheaf::render
