// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PrincipledAt: a principled Bsdf seen from one direction; principled_lobe.h describes the model.
// Directions come in the axes of the anisotropy. Its functions for glass are in principled_glass.h,
// which is included with it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "common/math/frame.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/microfacet.h"
#include "worker/render/bsdf/principled_shares.h"

namespace sheaf::render {

// Indices closer to 1 do not bend light (material.cc has the same limit).
inline constexpr float kPrincipledIndexDifferenceMin = 1e-4f;

// A principled Bsdf seen from wo.
template <typename Color>
class PrincipledAt {
 public:
  PrincipledAt(const BsdfOf<Color>& bsdf, Vec3f wo, bool inside);
  BsdfValueOf<Color> Eval(Vec3f wi) const;
  std::optional<BsdfSampleOf<Color>> Sample(float u_lobe, Vec2f u) const;
  // The part of Eval's f that the body and the sheen scatter.
  Color DiffusePart(Vec3f wi) const;

 private:
  enum Part { kSheen, kCoat, kReflection, kReturn, kBody, kGlass, kPartCount };

  static constexpr float kInvPi = static_cast<float>(1 / kPi);

  // The share that sheen and coat leave to the base, of light at a cosine.
  // coat_mu: to the coat's normal.
  float Below(float mu, float coat_mu) const {
    return BelowSheen(mu) * (1 - bsdf_.top.coat * CoatAlbedoAt(coat_mu));
  }
  float BelowSheen(float mu) const {
    return s_.has_sheen ? 1 - sheen_max_ * s_.sheen.albedo.At(FindMu(mu)) : 1;
  }
  float CoatAlbedoAt(float mu) const {
    if (bsdf_.top.coat == 0) return 0;
    return s_.coat.IsSmooth() ? FresnelDielectric(mu, s_.coat_eta).reflectance
                              : s_.coat_albedo.At(FindMu(mu));
  }
  // Turns the directions at the coat to its own normal.
  void TiltCoat(bool inside);
  void SetProbabilities();
  void AddReflections(Vec3f wi, BsdfValueOf<Color>* value) const;
  void AddCoat(Vec3f wi, BsdfValueOf<Color>* value) const;
  void AddSheet(Vec3f wi, BsdfValueOf<Color>* value) const;
  void AddSolid(Vec3f wi, BsdfValueOf<Color>* value) const;
  void AddSolidReturn(Vec3f wi, BsdfValueOf<Color>* value) const;
  std::optional<BsdfSampleOf<Color>> SampleDelta(Part part, float u) const;
  std::optional<Vec3f> SampleGlass(float u_lobe, Vec2f u) const;

  // Reflectance of the two faces of a sheet, with all orders between them.
  static Color OfBothFaces(const Color& once) {
    return MakeColor<Color>([&](size_t c) { return 2 * once[c] / (1 + once[c]); });
  }
  Color SheetFresnel(float cosine) const { return OfBothFaces(shares_.Dielectric(cosine)); }
  Color GlassFresnel(float cosine) const {
    return within_ ? shares_.DielectricWithin(cosine) : shares_.Dielectric(cosine);
  }
  Color BaseFresnel(float cosine) const {
    Color f = Color::Gray(0);
    if (metal_ > 0) f += shares_.Metal(cosine) * metal_;
    if (opaque_ > 0) f += shares_.Dielectric(cosine) * opaque_;
    return f;
  }
  // The lobe of returned energy of a solid's boundary, from the side of wo.
  struct SolidReturn {
    Color lost;      // At wo.
    Color crossing;  // Its fraction that crosses.
  };
  SolidReturn ReturnOfSolid() const;
  // As the sampler chooses: fraction of the returned energy that crosses.
  float CrossingProbability(const SolidReturn& r) const {
    return std::clamp(MeanComponent(r.crossing), 0.0f, 1.0f);
  }
  float GlassLossProbability() const {
    return s_.thin ? loss_o_ : shares_.GlassLoss(within_).Loss(o_);
  }

  const BsdfOf<Color>& bsdf_;
  const PrincipledSurface& s_;
  const Vec3f wo_;
  Vec3f coat_o_;      // wo in coat_frame_.
  Frame coat_frame_;  // The coat's normal, if it has one of its own.
  bool coat_tilted_ = false;
  const MuPosition o_;
  const Ggx ggx_;
  const PrincipledShares<Color> shares_;
  float metal_, opaque_, glass_;
  bool within_;                 // wo is inside of solid glass.
  bool smooth_, glass_smooth_;  // Delta lobes.
  float side_eta_;              // The far side over the near side of solid glass.
  float sheen_max_ = 0;
  float below_sheen_ = 1, below_ = 1;
  float loss_o_ = 0;
  Color return_color_{};   // The lobe of returned energy of metal and reflection.
  Color body_{};           // Body's albedo at wo, over 1 - R(i).
  Color opaque_return_{};  // Tint of the opaque dielectric's returned energy.
  std::array<float, kPartCount> probability_{};
};

// Whether all of its light leaves by delta lobes: BsdfShape::specular.
template <typename Color>
bool IsPrincipledSpecular(const BsdfOf<Color>& bsdf) {
  const PrincipledSurface& s = *bsdf.principled;
  const bool is_smooth = Ggx{bsdf.alpha_x, bsdf.alpha_y}.IsSmooth();
  const bool has_body = bsdf.base.metallic < 1 && bsdf.base.transmission < 1;
  const bool has_metal = bsdf.base.metallic > 0;
  const bool bends = s.rise.eta - 1 >= kPrincipledIndexDifferenceMin;
  if (has_body || (!is_smooth && (has_metal || bends))) return false;
  if (s.has_sheen && !bsdf.conductor_k.IsBlack()) return false;
  return bsdf.top.coat == 0 || s.coat.IsSmooth();
}

template <typename Color>
PrincipledAt<Color>::PrincipledAt(const BsdfOf<Color>& bsdf, Vec3f wo, bool inside)
    : bsdf_(bsdf),
      s_(*bsdf.principled),
      wo_(wo),
      coat_o_(wo),
      o_(FindMu(wo.z)),
      ggx_{bsdf.alpha_x, bsdf.alpha_y},
      shares_(bsdf) {
  metal_ = bsdf.base.metallic;
  glass_ = (1 - metal_) * bsdf.base.transmission;
  opaque_ = (1 - metal_) * (1 - bsdf.base.transmission);
  within_ = inside && glass_ > 0 && !s_.thin;
  smooth_ = ggx_.IsSmooth();
  glass_smooth_ = smooth_ || s_.rise.eta - 1 < kPrincipledIndexDifferenceMin;
  side_eta_ = within_ ? 1 / s_.rise.eta : s_.rise.eta;
  if (s_.has_sheen) sheen_max_ = std::min(1.0f, MaxComponent(bsdf.conductor_k));
  if (!within_) {
    if (!bsdf.coat_tilt.IsFlat()) TiltCoat(inside);
    below_sheen_ = BelowSheen(wo.z);
    below_ = Below(wo.z, coat_o_.z);
  }
  const BlendedLoss loss = shares_.MirrorLoss();
  const float average_loss = loss.Average();
  loss_o_ = loss.Loss(o_);
  const auto tint = [&](const Color& average) {
    return MakeColor<Color>([&](size_t c) { return TintOfReturn(average[c], average_loss); });
  };
  const bool returns = average_loss > 0;
  if (metal_ > 0 && returns) return_color_ += tint(shares_.MetalAverage()) * metal_;
  if (opaque_ > 0) {
    if (returns) opaque_return_ = tint(shares_.DielectricAverage());
    return_color_ += opaque_return_ * opaque_;
    const Color reflected = shares_.DielectricReflected(o_) + opaque_return_ * loss_o_;
    const Color average =
        shares_.DielectricReflected(typename PrincipledShares<Color>::Averaged{}) +
        opaque_return_ * average_loss;
    body_ = MakeColor<Color>([&](size_t c) {
      constexpr float kRestMin = 1e-5f;  // Less reaches no body.
      const float rest = 1 - average[c];
      return rest > kRestMin ? bsdf.color[c] * std::max(0.0f, 1 - reflected[c]) / rest : 0;
    });
  }
  SetProbabilities();
}

template <typename Color>
void PrincipledAt<Color>::TiltCoat(bool inside) {
  Vec3f n = bsdf_.coat_tilt.Normal();
  // Seen from below, the frame's z is turned over, and the normal points to that side.
  if (inside) n = {-n.x, -n.y, n.z};
  if (s_.turned) {
    n = {s_.turn.cos * n.x + s_.turn.sin * n.y, s_.turn.cos * n.y - s_.turn.sin * n.x, n.z};
  }
  const Frame frame = Frame::FromNormal(n);
  const Vec3f o = frame.ToLocal(wo_);
  coat_tilted_ = o.z > 0;
  if (!coat_tilted_) return;
  coat_frame_ = frame;
  coat_o_ = o;
}

template <typename Color>
void PrincipledAt<Color>::SetProbabilities() {
  // Glass is chosen as often from either side: only so are its delta lobes reversible.
  probability_[kGlass] = glass_ * below_;
  std::array<float, kGlass> weight{};
  if (!within_) {
    if (s_.has_sheen) weight[kSheen] = sheen_max_ * s_.sheen.albedo.At(o_);
    weight[kCoat] = below_sheen_ * bsdf_.top.coat * CoatAlbedoAt(coat_o_.z);
  }
  if (metal_ + opaque_ > 0) {
    Color reflected = Color::Gray(0);
    if (smooth_) {
      reflected = BaseFresnel(wo_.z);
    } else {
      if (metal_ > 0) reflected += shares_.MetalReflected(o_) * metal_;
      if (opaque_ > 0) reflected += shares_.DielectricReflected(o_) * opaque_;
    }
    weight[kReflection] = below_ * MaxComponent(reflected);
    weight[kReturn] = below_ * MaxComponent(return_color_) * loss_o_;
    if (opaque_ > 0) {
      const float average =
          MeanComponent(shares_.DielectricReflected(typename PrincipledShares<Color>::Averaged{}));
      weight[kBody] = below_ * opaque_ * MaxComponent(body_) * std::max(0.0f, 1 - average);
    }
  }
  float sum = 0;
  for (const float w : weight) sum += w;
  if (!(sum > 0)) return;
  const float scale = (1 - probability_[kGlass]) / sum;
  for (size_t i = 0; i < weight.size(); ++i) probability_[i] = scale * weight[i];
}

template <typename Color>
BsdfValueOf<Color> PrincipledAt<Color>::Eval(Vec3f wi) const {
  BsdfValueOf<Color> value;
  if (wi.z > 0) AddReflections(wi, &value);
  if (glass_ > 0 && !glass_smooth_ && wi.z != 0) {
    if (s_.thin) {
      AddSheet(wi, &value);
    } else {
      AddSolid(wi, &value);
      AddSolidReturn(wi, &value);
    }
  }
  return value;
}

template <typename Color>
Color PrincipledAt<Color>::DiffusePart(Vec3f wi) const {
  Color part{};
  if (!(wi.z > 0)) return part;
  if (!within_ && s_.has_sheen) part += bsdf_.conductor_k * s_.sheen.Value(wo_, wi);
  if (opaque_ > 0) {
    const MuPosition i = FindMu(wi.z);
    const Color left =
        OneMinus(shares_.DielectricReflected(i) + opaque_return_ * shares_.MirrorLoss().Loss(i));
    part += body_ * left * (below_ * opaque_ * wi.z * kInvPi);
  }
  return part;
}

template <typename Color>
void PrincipledAt<Color>::AddReflections(Vec3f wi, BsdfValueOf<Color>* value) const {
  const MuPosition i = FindMu(wi.z);
  const Vec3f m = Normalize(wo_ + wi);
  const float cosine = std::min(1.0f, Dot(wo_, m));
  if (!within_ && s_.has_sheen) {
    value->f_cos += bsdf_.conductor_k * s_.sheen.Value(wo_, wi);
    value->pdf += probability_[kSheen] * s_.sheen.lobe.Pdf(i, wi.z);
  }
  if (!within_ && bsdf_.top.coat > 0 && !s_.coat.IsSmooth()) AddCoat(wi, value);
  if (metal_ + opaque_ > 0 && !smooth_) {
    const float d = ggx_.D(m);
    value->f_cos += BaseFresnel(cosine) * (below_ * d * ggx_.G2Over4Cos(wo_, wi) * wi.z);
    value->pdf += probability_[kReflection] * 0.5f * d / (wo_.z + ggx_.S(wo_));
    const BlendedLoss loss = shares_.MirrorLoss();
    value->f_cos += return_color_ * (below_ * loss_o_ * loss.LossOverAverage(i) * wi.z * kInvPi);
    value->pdf += probability_[kReturn] * loss.Pdf(i, wi.z);
  }
  if (opaque_ > 0) {
    const Color left =
        OneMinus(shares_.DielectricReflected(i) + opaque_return_ * shares_.MirrorLoss().Loss(i));
    value->f_cos += body_ * left * (below_ * opaque_ * wi.z * kInvPi);
    value->pdf += probability_[kBody] * wi.z * kInvPi;
  }
}

template <typename Color>
void PrincipledAt<Color>::AddCoat(Vec3f wi, BsdfValueOf<Color>* value) const {
  const Vec3f i = coat_tilted_ ? coat_frame_.ToLocal(wi) : wi;
  if (!(i.z > 0)) return;
  const Vec3f m = Normalize(coat_o_ + i);
  const float cosine = std::min(1.0f, Dot(coat_o_, m));
  const float d = s_.coat.D(m), f = FresnelDielectric(cosine, s_.coat_eta).reflectance;
  value->f_cos +=
      Color::Gray(below_sheen_ * bsdf_.top.coat * f * d * s_.coat.G2Over4Cos(coat_o_, i) * i.z);
  value->pdf += probability_[kCoat] * 0.5f * d / (coat_o_.z + s_.coat.S(coat_o_));
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> PrincipledAt<Color>::Sample(float u_lobe, Vec2f u) const {
  // The number that chooses the part is spent again within it.
  size_t part = 0;
  while (part + 1 < kPartCount && u_lobe >= probability_[part]) u_lobe -= probability_[part++];
  if (!(probability_[part] > 0) || u_lobe >= probability_[part]) return std::nullopt;
  const float rest = std::min(u_lobe / probability_[part], 0x1.fffffep-1f);
  std::optional<Vec3f> wi;
  uint8_t flags = 0;
  switch (static_cast<Part>(part)) {
    case kSheen:
      wi = DirectionAtMu(s_.sheen.lobe.SampleMu(u.x), u.y);
      break;
    case kCoat:
      if (s_.coat.IsSmooth()) return SampleDelta(kCoat, rest);
      wi = Reflect(coat_o_, s_.coat.SampleVisibleNormal(coat_o_, u));
      if (coat_tilted_) wi = coat_frame_.ToWorld(*wi);
      break;
    case kReflection:
      if (smooth_) return SampleDelta(kReflection, rest);
      wi = Reflect(wo_, ggx_.SampleVisibleNormal(wo_, u));
      break;
    case kReturn:
      wi = shares_.MirrorLoss().Sample(rest, u);
      break;
    case kBody:
      wi = SampleCosineHemisphere(u);
      flags = kBsdfDiffuse;
      break;
    default:
      if (glass_smooth_) return SampleDelta(kGlass, rest);
      wi = SampleGlass(rest, u);
  }
  if (!wi || (part != kGlass && !(wi->z > 0))) return std::nullopt;
  const bool crosses = wi->z < 0;
  const bool bends = crosses && !s_.thin;
  if (crosses) flags = kBsdfTransmission;
  return FinishSample(Eval(*wi), *wi, flags, bends ? side_eta_ * side_eta_ : 1.0f);
}

// Each delta lobe has the same weight and probability in both directions of its light.
template <typename Color>
std::optional<BsdfSampleOf<Color>> PrincipledAt<Color>::SampleDelta(Part part, float u) const {
  BsdfSampleOf<Color> sample;
  sample.wi = {-wo_.x, -wo_.y, wo_.z};
  sample.flags = kBsdfSpecular;
  const auto finish = [&](const Color& value, float probability) {
    sample.weight = value / probability;
    return sample.weight.IsBlack() ? std::nullopt : std::optional(sample);
  };
  const float chosen = probability_[part];
  if (part == kCoat) {
    return finish(Color::Gray(below_sheen_ * bsdf_.top.coat * CoatAlbedoAt(wo_.z)), chosen);
  }
  if (part == kReflection) return finish(BaseFresnel(wo_.z) * below_, chosen);
  const Color f = s_.thin ? SheetFresnel(wo_.z) : GlassFresnel(wo_.z);
  const DielectricFresnel fresnel = FresnelDielectric(wo_.z, side_eta_);
  // Light that leaves a solid passes its layers, which reflect the rest back into it.
  const float cos_out = std::min(1.0f, fresnel.cos_t);
  const float leaving = within_ ? Below(cos_out, cos_out) : 1;
  const float p_cross = (1 - MeanComponent(f)) * leaving;
  if (u >= p_cross || (!s_.thin && !(fresnel.cos_t > 0))) {
    const Color reflected = f + OneMinus(f) * (1 - leaving);
    return finish(reflected * (glass_ * below_), chosen * (1 - p_cross));
  }
  sample.flags |= kBsdfTransmission;
  const float eta2 = s_.thin ? 1 : side_eta_ * side_eta_;
  sample.wi = s_.thin ? -wo_ : Vec3f{-wo_.x / side_eta_, -wo_.y / side_eta_, -fresnel.cos_t};
  sample.eta_scale = eta2;
  return finish(bsdf_.color * OneMinus(f) * (glass_ * below_ * leaving / eta2), chosen * p_cross);
}

}  // namespace sheaf::render
