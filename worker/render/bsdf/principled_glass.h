// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PrincipledAt's glass: rough sheets, and the rough boundary of solids with what single scattering
// loses there.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "worker/render/bsdf/principled_at.h"

namespace sheaf::render {

// What crosses a sheet leaves by the same lobe as what it reflects, on the other side.
template <typename Color>
void PrincipledAt<Color>::AddSheet(Vec3f wi, BsdfValueOf<Color>* value) const {
  const bool crosses = wi.z < 0;
  const Vec3f mirrored{wi.x, wi.y, std::fabs(wi.z)};
  const Vec3f m = Normalize(wo_ + mirrored);
  const float d = ggx_.D(m);
  const auto color = [&](const Color& f) { return crosses ? bsdf_.color * OneMinus(f) : f; };
  const auto share = [&](const Color& f) {
    return crosses ? 1 - MeanComponent(f) : MeanComponent(f);
  };
  const Color f = SheetFresnel(std::min(1.0f, Dot(wo_, m)));
  value->f_cos += color(f) * (below_ * glass_ * d * ggx_.G2Over4Cos(wo_, mirrored) * mirrored.z);
  const float facet_pdf = 0.5f * d / (wo_.z + ggx_.S(wo_)) * share(f);
  const MuPosition i = FindMu(mirrored.z);
  const BlendedLoss loss = shares_.MirrorLoss();
  const Color average = OfBothFaces(shares_.DielectricAverage());
  value->f_cos +=
      color(average) * (below_ * glass_ * loss_o_ * loss.LossOverAverage(i) * mirrored.z * kInvPi);
  value->pdf += probability_[kGlass] *
                ((1 - loss_o_) * facet_pdf + loss_o_ * share(average) * loss.Pdf(i, mirrored.z));
}

// As EvalDielectricFacet, with colors.
template <typename Color>
void PrincipledAt<Color>::AddSolid(Vec3f wi, BsdfValueOf<Color>* value) const {
  const float visible = 2 / (wo_.z + ggx_.S(wo_));
  const float scale = probability_[kGlass] * (1 - GlassLossProbability());
  if (wi.z > 0) {
    const Vec3f m = Normalize(wo_ + wi);
    const float d = ggx_.D(m);
    const Color f = GlassFresnel(std::min(1.0f, Dot(wo_, m)));
    value->f_cos += f * (below_ * glass_ * d * ggx_.G2Over4Cos(wo_, wi) * wi.z);
    value->pdf += scale * 0.25f * visible * d * MeanComponent(f);
    return;
  }
  Vec3f m = wo_ + side_eta_ * wi;
  if (!(LengthSquared(m) > 0)) return;
  m = Normalize(m);
  if (m.z < 0) m = -m;
  const float cos_o = Dot(wo_, m), cos_i = Dot(wi, m);
  if (!(cos_o > 0) || !(cos_i < 0)) return;  // Not the two sides of this facet.
  const Color f = GlassFresnel(std::min(1.0f, cos_o));
  const float half = cos_i + cos_o / side_eta_;
  const float density = ggx_.D(m) * cos_o * std::fabs(cos_i) / (half * half);
  value->f_cos += bsdf_.color * OneMinus(f) *
                  (below_ * glass_ * density * 4 * ggx_.G2Over4Cos(wo_, wi) * std::fabs(wi.z) /
                   (side_eta_ * side_eta_));
  value->pdf += scale * density * visible * (1 - MeanComponent(f));
}

template <typename Color>
typename PrincipledAt<Color>::SolidReturn PrincipledAt<Color>::ReturnOfSolid() const {
  const typename PrincipledShares<Color>::Averaged averaged;
  const Color near_average = shares_.GlassLost(within_, averaged);
  const Color far_average = shares_.GlassLost(!within_, averaged);
  const Color reflected = shares_.DielectricAverage();
  // As MakeDielectricEnergyRow: reciprocal, and within [0, 1].
  SolidReturn r{shares_.GlassLost(within_, o_), {}};
  r.crossing = MakeColor<Color>([&](size_t c) {
    const float crossing = (1 - reflected[c]) * std::min(near_average[c], far_average[c]);
    if (!(near_average[c] > 0)) return 0.0f;
    return crossing / near_average[c] * (within_ ? side_eta_ * side_eta_ : 1.0f);
  });
  return r;
}

template <typename Color>
void PrincipledAt<Color>::AddSolidReturn(Vec3f wi, BsdfValueOf<Color>* value) const {
  const float loss_probability = GlassLossProbability();
  if (!(loss_probability > 0)) return;
  const bool crosses = wi.z < 0;
  const bool far_within = crosses != within_;  // wi is inside.
  const float mu = std::fabs(wi.z);
  const MuPosition i = FindMu(mu);
  const SolidReturn r = ReturnOfSolid();
  const Color lost_i = shares_.GlassLost(far_within, i);
  const Color average = shares_.GlassLost(far_within, typename PrincipledShares<Color>::Averaged{});
  const float radiance_scale = crosses ? 1 / (side_eta_ * side_eta_) : 1.0f;
  value->f_cos += MakeColor<Color>([&](size_t c) {
    if (!(average[c] > 0)) return 0.0f;
    const float share = crosses ? bsdf_.color[c] * r.crossing[c] : 1 - r.crossing[c];
    return below_ * glass_ * share * r.lost[c] * lost_i[c] / average[c] * radiance_scale * mu *
           kInvPi;
  });
  const float crossing = CrossingProbability(r);
  value->pdf += probability_[kGlass] * loss_probability * (crosses ? crossing : 1 - crossing) *
                shares_.GlassLoss(far_within).Pdf(i, mu);
}

template <typename Color>
std::optional<Vec3f> PrincipledAt<Color>::SampleGlass(float u_lobe, Vec2f u) const {
  const float loss = GlassLossProbability();
  if (u_lobe < loss) {
    const float u_side = u_lobe / loss;
    const float crossing = s_.thin ? 1 - MeanComponent(OfBothFaces(shares_.DielectricAverage()))
                                   : CrossingProbability(ReturnOfSolid());
    const bool crosses = u_side < crossing;
    const float u_row = crosses ? u_side / crossing : (u_side - crossing) / (1 - crossing);
    const Vec3f w = s_.thin ? shares_.MirrorLoss().Sample(u_row, u)
                            : shares_.GlassLoss(crosses != within_).Sample(u_row, u);
    return crosses ? Vec3f{w.x, w.y, -w.z} : w;
  }
  const float u_facet = (u_lobe - loss) / (1 - loss);
  const Vec3f m = ggx_.SampleVisibleNormal(wo_, u);
  const float cosine = std::min(1.0f, Dot(wo_, m));
  if (!(cosine > 0)) return std::nullopt;
  const Color f = s_.thin ? SheetFresnel(cosine) : GlassFresnel(cosine);
  const bool reflects = u_facet < MeanComponent(f);
  Vec3f wi = Reflect(wo_, m);
  if (s_.thin) {
    if (!(wi.z > 0)) return std::nullopt;
    return reflects ? wi : Vec3f{wi.x, wi.y, -wi.z};
  }
  if (!reflects) {
    const DielectricFresnel fresnel = FresnelDielectric(cosine, side_eta_);
    if (!(fresnel.cos_t > 0)) return std::nullopt;
    wi = Normalize(Refract(wo_, m, cosine, side_eta_, fresnel.cos_t));
  }
  if (reflects != (wi.z > 0)) return std::nullopt;
  return wi;
}

}  // namespace sheaf::render
