// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Dielectric interfaces: smooth; rough (GGX, with the lost energy given back on both sides); and
// thin slabs. Radiance transport: what crosses is divided by eta^2, the widening of its solid
// angle. Directions come with wo.z > 0 and eta as far side over near side; bsdf_inl.h turns the
// other side over, which `inside` remembers. Sources: Walter et al. 2007, "Microfacet Models for
// Refraction through Rough Surfaces"; Veach 1997, sec. 5.2 (radiance across an interface).
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

// Single scattering: f * |cos wi| and the pdf.
template <typename Color>
BsdfValueOf<Color> EvalDielectricFacet(const Ggx& ggx, float eta, Vec3f wo, Vec3f wi) {
  const float visible = 2 / (wo.z + ggx.S(wo));  // Visible-normal pdf over D and Dot(wo, m).
  if (wi.z > 0) {
    const Vec3f m = Normalize(wo + wi);
    const float d = ggx.D(m);
    const float fresnel = FresnelDielectric(std::min(1.0f, Dot(wo, m)), eta).reflectance;
    return {Color::Gray(fresnel * d * ggx.G2Over4Cos(wo, wi) * wi.z),
            0.25f * visible * d * fresnel};
  }
  Vec3f m = wo + eta * wi;
  if (!(LengthSquared(m) > 0)) return {};
  m = Normalize(m);
  if (m.z < 0) m = -m;
  const float cos_o = Dot(wo, m), cos_i = Dot(wi, m);
  if (!(cos_o > 0) || !(cos_i < 0)) return {};  // Not the two sides of this facet.
  const float transmittance = 1 - FresnelDielectric(std::min(1.0f, cos_o), eta).reflectance;
  const float half = cos_i + cos_o / eta;
  // Solid angle of facets over solid angle of wi.
  const float dm_dwi = std::fabs(cos_i) / (half * half);
  const float scale = transmittance * ggx.D(m) * cos_o * dm_dwi;
  return {Color::Gray(scale * 4 * ggx.G2Over4Cos(wo, wi) * std::fabs(wi.z) / (eta * eta)),
          scale * visible};
}

struct DielectricLobe : LobeBase {
  using Material = DielectricMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kDielectric;
  static constexpr TraitBits kTraits = TraitSet(Trait::kSpecularTransmission);
  static constexpr bool kTransmits = true;

  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return EvalFrom<Color>(bsdf, SideOf(bsdf, inside), wo, wi);
  }

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                     float u_lobe, Vec2f u, bool inside) {
    return SampleFrom<Color>(bsdf, SideOf(bsdf, inside), wo, u_lobe, u);
  }

  template <typename Color>
  static float PDF(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return f(bsdf, wo, wi, inside).pdf;
  }

 private:
  struct Side {
    float eta = 1;        // Far over near side.
    bool inside = false;  // wo is on the side of index bsdf.eta.
  };
  static Side SideOf(const BsdfShape& bsdf, bool inside) {
    return {inside ? 1 / bsdf.eta : bsdf.eta, inside};
  }

  // The loss lobes on either side and how they are chosen.
  struct Returned {
    BlendedLoss near_side, far_side;
    float transmit = 0;  // Share of the returned energy that crosses.
  };
  static Returned MakeReturn(const BsdfShape& bsdf, Side side) {
    const DielectricEnergyRow* row = bsdf.dielectric_energy;
    const BlendedLoss outside = LossOutside(row, bsdf.blend), inside = LossInside(row, bsdf.blend);
    float transmit = side.inside ? row[0].transmit_in : row[0].transmit_out;
    if (bsdf.blend > 0) {
      const float next = side.inside ? row[1].transmit_in : row[1].transmit_out;
      transmit += bsdf.blend * (next - transmit);
    }
    return {side.inside ? inside : outside, side.inside ? outside : inside, transmit};
  }

  template <typename Color>
  static BsdfValueOf<Color> EvalFrom(const BsdfShape& bsdf, Side side, Vec3f wo, Vec3f wi);

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> SampleSmooth(float eta, Vec3f wo, float u_lobe);

  // A direction by a visible facet; none where the facet sends it to the wrong side.
  static std::optional<Vec3f> SampleFacet(const Ggx& ggx, float eta, Vec3f wo, float u_lobe,
                                          Vec2f u) {
    const Vec3f m = ggx.SampleVisibleNormal(wo, u);
    const float cos_o = std::min(1.0f, Dot(wo, m));
    if (!(cos_o > 0)) return std::nullopt;
    const DielectricFresnel fresnel = FresnelDielectric(cos_o, eta);
    const bool reflects = u_lobe < fresnel.reflectance;
    const Vec3f wi =
        reflects ? Reflect(wo, m) : Normalize(Refract(wo, m, cos_o, eta, fresnel.cos_t));
    if (reflects != (wi.z > 0)) return std::nullopt;
    return wi;
  }

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> SampleFrom(const BsdfShape& bsdf, Side side, Vec3f wo,
                                                       float u_lobe, Vec2f u);
};

template <typename Color>
BsdfValueOf<Color> DielectricLobe::EvalFrom(const BsdfShape& bsdf, Side side, Vec3f wo, Vec3f wi) {
  if (bsdf.specular || wi.z == 0) return {};
  const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
  BsdfValueOf<Color> value = EvalDielectricFacet<Color>(ggx, side.eta, wo, wi);
  if (bsdf.dielectric_energy == nullptr) return value;
  const Returned returned = MakeReturn(bsdf, side);
  const float loss_o = returned.near_side.Loss(FindMu(wo.z));
  const bool crosses = wi.z < 0;
  const BlendedLoss& lobe = crosses ? returned.far_side : returned.near_side;
  const float share = loss_o * (crosses ? returned.transmit : 1 - returned.transmit);
  const float radiance_scale = crosses ? 1 / (side.eta * side.eta) : 1.0f;
  const float mu_i = std::fabs(wi.z);
  const MuPosition i = FindMu(mu_i);
  value.f_cos += Color::Gray(share * radiance_scale * lobe.LossOverAverage(i) * mu_i *
                             static_cast<float>(1 / kPi));
  value.pdf = (1 - loss_o) * value.pdf + share * lobe.Pdf(i, mu_i);
  return value;
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> DielectricLobe::SampleSmooth(float eta, Vec3f wo, float u_lobe) {
  const DielectricFresnel fresnel = FresnelDielectric(wo.z, eta);
  if (u_lobe < fresnel.reflectance) {
    return BsdfSampleOf<Color>{
        .wi = {-wo.x, -wo.y, wo.z}, .weight = Color::Gray(1), .flags = kBsdfSpecular};
  }
  const float eta2 = eta * eta;
  return BsdfSampleOf<Color>{.wi = {-wo.x / eta, -wo.y / eta, -fresnel.cos_t},
                             .weight = Color::Gray(1 / eta2),
                             .eta_scale = eta2,
                             .flags = kBsdfSpecular | kBsdfTransmission};
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> DielectricLobe::SampleFrom(const BsdfShape& bsdf, Side side,
                                                              Vec3f wo, float u_lobe, Vec2f u) {
  if (bsdf.specular) return SampleSmooth<Color>(side.eta, wo, u_lobe);
  std::optional<Vec3f> wi;
  float loss_o = 0;
  if (bsdf.dielectric_energy != nullptr) {
    const Returned returned = MakeReturn(bsdf, side);
    loss_o = returned.near_side.Loss(FindMu(wo.z));
    const float share_far = loss_o * returned.transmit;
    if (u_lobe < share_far) {
      wi = -returned.far_side.Sample(u_lobe / share_far, u);
    } else if (u_lobe < loss_o) {
      wi = returned.near_side.Sample((u_lobe - share_far) / (loss_o - share_far), u);
    }
  }
  if (!wi) {
    const Ggx ggx{bsdf.alpha_x, bsdf.alpha_y};
    wi = SampleFacet(ggx, side.eta, wo, (u_lobe - loss_o) / (1 - loss_o), u);
  }
  if (!wi) return std::nullopt;
  const bool crosses = wi->z < 0;
  return FinishSample(EvalFrom<Color>(bsdf, side, wo, *wi), *wi, crosses ? kBsdfTransmission : 0,
                      crosses ? side.eta * side.eta : 1.0f);
}

}  // namespace sheaf::render
