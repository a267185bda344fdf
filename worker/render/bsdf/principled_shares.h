// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PrincipledShares: the Fresnel terms of one principled Bsdf, and the shares of light (see
// principled_table.h) for its roughness and colors.
#pragma once

#include <algorithm>
#include <type_traits>
#include <vector>

#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/principled_table.h"

namespace sheaf::render {

// a + t (b - a), by component.
template <typename Color>
Color MixColors(const Color& a, const Color& b, float t) {
  return MakeColor<Color>([&](size_t c) { return a[c] + t * (b[c] - a[c]); });
}
template <typename Color>
Color OneMinus(const Color& color) {
  return MakeColor<Color>([&](size_t c) { return std::max(0.0f, 1 - color[c]); });
}
template <typename Color>
float MeanComponent(const Color& color) {
  float sum = 0;
  for (size_t c = 0; c < kComponentCount<Color>; ++c) sum += color[c];
  return sum / static_cast<float>(kComponentCount<Color>);
}

template <typename Color>
class PrincipledShares {
 public:
  explicit PrincipledShares(const BsdfOf<Color>& bsdf)
      : bsdf_(bsdf), surface_(*bsdf.principled), rows_(surface_.table->rows.data()) {
    if (surface_.table->rows.size() > 1) {
      const RowBlend at = FindAlphaRow(EquivalentAlpha({bsdf.alpha_x, bsdf.alpha_y}));
      rows_ += at.index;
      blend_ = at.fraction;
    }
    f90_ = Color::Gray(bsdf.top.specular);
    f0_ = MakeColor<Color>([&](size_t c) {
      return std::min(1.0f, surface_.rise.f0 * bsdf.conductor_eta[c]) * bsdf.top.specular;
    });
    film_weight_ = surface_.has_film ? bsdf.blend : 0;
  }

  // --- Fresnel terms at a facet. cosine: outside, in [0, 1].
  Color Dielectric(float cosine) const {
    const Color plain = MixColors(f0_, f90_, surface_.rise.At(cosine));
    if (film_weight_ == 0) return plain;
    return MixColors(plain,
                     FilmOnDielectric(surface_.film, cosine, surface_.rise.eta, bsdf_.albedo) *
                         bsdf_.top.specular,
                     film_weight_);
  }
  // For light from the inside of a solid, at the cosine there.
  Color DielectricWithin(float cosine) const {
    const DielectricFresnel fresnel = FresnelDielectric(cosine, 1 / surface_.rise.eta);
    if (!(fresnel.cos_t > 0)) return Color::Gray(1);
    return Dielectric(std::min(1.0f, fresnel.cos_t));
  }
  Color Metal(float cosine) const {
    const Color plain = MixColors(bsdf_.color, Color::Gray(1), SchlickWeight(cosine));
    if (film_weight_ == 0) return plain;
    return MixColors(plain, FilmOnMetal(surface_.film, cosine, bsdf_.color, bsdf_.albedo),
                     film_weight_);
  }

  // --- Averages over facets.
  BlendedLoss MirrorLoss() const { return LossOf(&PrincipledRow::mirror_loss); }
  // within: on the inside.
  BlendedLoss GlassLoss(bool within) const {
    return LossOf(within ? &PrincipledRow::glass_loss_in : &PrincipledRow::glass_loss_out);
  }
  // Reflected by the dielectric after one scattering. `At` is a MuPosition, or Averaged{}.
  struct Averaged {};
  template <typename At>
  Color DielectricReflected(const At& at) const {
    return Reflected(&PrincipledRow::out, at);
  }
  template <typename At>
  Color MetalReflected(const At& at) const {
    const float schlick = Get(
        at, [](const PrincipledRow& r) -> auto& { return r.schlick; });
    const float mirror = Get(
        at, [](const PrincipledRow& r) -> auto& { return r.out.mirror; });
    return MakeColor<Color>(
        [&](size_t c) { return bsdf_.color[c] * (mirror - schlick) + schlick; });
  }
  // Neither reflected nor refracted by the boundary of a solid, after one scattering.
  template <typename At>
  Color GlassLost(bool within, const At& at) const {
    const auto side = within ? &PrincipledRow::in : &PrincipledRow::out;
    const float cross = Share(side, &FacetShares::cross, at);
    const float cross_rise = Share(side, &FacetShares::cross_rise, at);
    Color kept = Linear(cross - cross_rise, cross_rise);
    if (film_weight_ != 0)
      kept = MixColors(kept, Film(side, &FacetShares::film_cross, at), film_weight_);
    return OneMinus(Reflected(side, at) + Color::Gray(cross) + kept * -1.0f);
  }

  // Cosine-weighted averages of the Fresnel terms of smooth surfaces.
  Color DielectricAverage() const {
    const Color plain = MixColors(f0_, f90_, surface_.table->rise_average);
    if (film_weight_ == 0) return plain;
    const Color film = ByComponent([&](size_t i) { return surface_.table->film_average[i]; });
    return MixColors(plain, film * bsdf_.top.specular, film_weight_);
  }
  Color MetalAverage() const {
    constexpr float kSchlickAverage = 1.0f / 21;
    constexpr float kMeanCosine = 2.0f / 3;  // At which a film stands for its average.
    const Color plain = MixColors(bsdf_.color, Color::Gray(1), kSchlickAverage);
    return film_weight_ == 0 ? plain : MixColors(plain, Metal(kMeanCosine), film_weight_);
  }

 private:
  using Side = FacetShares PrincipledRow::*;
  using Kind = AveragedCurve FacetShares::*;
  using FilmKind = std::vector<AveragedCurve> FacetShares::*;

  static float ValueOf(const AveragedCurve& curve, MuPosition at) { return curve.curve.At(at); }
  static float ValueOf(const AveragedCurve& curve, Averaged) { return curve.average; }
  // The blend of two rows.
  template <typename At, typename CurveOf>
  float Get(const At& at, const CurveOf& curve_of) const {
    const float first = ValueOf(curve_of(rows_[0]), at);
    return blend_ > 0 ? first + blend_ * (ValueOf(curve_of(rows_[1]), at) - first) : first;
  }
  template <typename At>
  float Share(Side side, Kind kind, const At& at) const {
    return Get(
        at, [=](const PrincipledRow& row) -> auto& { return row.*side.*kind; });
  }
  // By component, what value(i) gives for the i-th of a film's curves.
  template <typename Value>
  Color ByComponent(const Value& value) const {
    if constexpr (std::is_same_v<Color, Rgb>) {
      return MakeColor<Color>(value);
    } else {
      return MakeColor<Color>([&](size_t c) {
        const float t = std::clamp((bsdf_.albedo[c] - kWavelengthMinNm) / kFilmStepNm, 0.0f,
                                   static_cast<float>(kFilmNodeCount - 1));
        const size_t i = std::min(static_cast<size_t>(t), static_cast<size_t>(kFilmNodeCount - 2));
        const float first = value(i);
        return first + (t - static_cast<float>(i)) * (value(i + 1) - first);
      });
    }
  }
  template <typename At>
  Color Film(Side side, FilmKind kind, const At& at) const {
    return ByComponent([&](size_t i) {
             return Get(
                 at, [=](const PrincipledRow& row) -> auto& { return (row.*side.*kind)[i]; });
           }) *
           bsdf_.top.specular;
  }
  Color Linear(float f0_share, float f90_share) const {
    return MakeColor<Color>([&](size_t c) { return f0_[c] * f0_share + f90_[c] * f90_share; });
  }
  template <typename At>
  Color Reflected(Side side, const At& at) const {
    const float rise = Share(side, &FacetShares::rise, at);
    const float total = Share(side, &FacetShares::total, at);
    Color reflected = Linear(Share(side, &FacetShares::mirror, at) - total - rise, rise);
    if (film_weight_ != 0) {
      reflected = MixColors(reflected, Film(side, &FacetShares::film, at), film_weight_);
    }
    return reflected + Color::Gray(total);
  }
  BlendedLoss LossOf(LossLobe PrincipledRow::*lobe) const {
    return {&(rows_[0].*lobe), blend_ > 0 ? &(rows_[1].*lobe) : nullptr, blend_};
  }

  const BsdfOf<Color>& bsdf_;
  const PrincipledSurface& surface_;
  const PrincipledRow* rows_;
  float blend_ = 0, film_weight_ = 0;
  Color f0_, f90_;
};

}  // namespace sheaf::render
