// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/principled_table.h"

#include <algorithm>
#include <array>
#include <tuple>

#include "worker/render/bsdf/facet_quadrature.h"
#include "worker/render/bsdf/made_tables.h"

namespace sheaf::render {
namespace {

constexpr int kCosineCount = 256;  // Steps of the film's reflectance over the cosine.

// A film's reflectance of one component by cosine.
struct FilmCurve {
  std::array<float, kCosineCount + 1> value{};

  float At(float cosine) const {
    const float t = std::clamp(cosine, 0.0f, 1.0f) * kCosineCount;
    const int index = std::min(static_cast<int>(t), kCosineCount - 1);
    const float* at = &value[static_cast<size_t>(index)];
    return at[0] + (t - static_cast<float>(index)) * (at[1] - at[0]);
  }
  double CosineAverage() const {
    double sum = 0;
    for (int i = 0; i < kCosineCount; ++i) {
      const float mu = (static_cast<float>(i) + 0.5f) / kCosineCount;
      sum += static_cast<double>(At(mu)) * 2 * static_cast<double>(mu) / kCosineCount;
    }
    return sum;
  }
};
template <size_t kCount>
using FilmCurves = std::array<FilmCurve, kCount>;

template <size_t kCount>
FilmCurves<kCount> MakeFilmCurves(const PrincipledTableOptions& options) {
  FilmCurves<kCount> curves{};
  if (options.film == nullptr) return curves;
  for (size_t i = 0; i <= kCosineCount; ++i) {
    const float mu = static_cast<float>(i) / kCosineCount;
    if constexpr (kCount == 3) {
      const Rgb rgb = FilmOnDielectric<Rgb>(*options.film, mu, options.eta, {});
      for (size_t c = 0; c < 3; ++c) curves[c].value[i] = rgb[c];
    } else {
      for (size_t c = 0; c < kCount; ++c) {
        const float nm = kWavelengthMinNm + static_cast<float>(c) * kFilmStepNm;
        curves[c].value[i] =
            FilmOnDielectric(*options.film, mu, options.eta, Spectral::Gray(nm))[0];
      }
    }
  }
  return curves;
}

// Sums over facets, of one side.
template <size_t kCount>
struct ShareSum {
  double mirror = 0, rise = 0, schlick = 0, total = 0, cross = 0, cross_rise = 0;
  std::array<double, kCount> film{}, film_cross{};

  ShareSum& operator+=(const ShareSum& b) {
    mirror += b.mirror;
    rise += b.rise;
    schlick += b.schlick;
    total += b.total;
    cross += b.cross;
    cross_rise += b.cross_rise;
    for (size_t i = 0; i < kCount; ++i) film[i] += b.film[i];
    for (size_t i = 0; i < kCount; ++i) film_cross[i] += b.film_cross[i];
    return *this;
  }
  ShareSum operator*(double s) const {
    ShareSum r{mirror * s, rise * s, schlick * s, total * s, cross * s, cross_rise * s, {}, {}};
    for (size_t i = 0; i < kCount; ++i) r.film[i] = film[i] * s;
    for (size_t i = 0; i < kCount; ++i) r.film_cross[i] = film_cross[i] * s;
    return r;
  }
};

template <size_t kCount>
class RowMaker {
 public:
  explicit RowMaker(const PrincipledTableOptions& options)
      : options_(options),
        rise_(FresnelRise::Make(options.eta)),
        film_(MakeFilmCurves<kCount>(options)) {}

  PrincipledRow Make(const Ggx& ggx) const {
    PrincipledRow row;
    row.out = SharesOf(ggx, false, &row.schlick);
    AveragedCurve unused;
    if (options_.refracts) row.in = SharesOf(ggx, true, &unused);
    row.mirror_loss = LossLobe::Make(LossOf(ggx, [&](int i) { return MirrorLoss(row.out, i); }));
    if (!options_.refracts) return row;
    row.glass_loss_out = LossLobe::Make(LossOf(ggx, [&](int i) { return GlassLoss(row.out, i); }));
    row.glass_loss_in = LossLobe::Make(LossOf(ggx, [&](int i) { return GlassLoss(row.in, i); }));
    return row;
  }

  void SetAverages(PrincipledTable* table) const {
    constexpr int kAverageCount = 512;
    double sum = 0;
    for (int i = 0; i < kAverageCount; ++i) {
      const double mu2 = (i + 0.5) / kAverageCount;
      sum += static_cast<double>(rise_.At(static_cast<float>(std::sqrt(mu2))));
    }
    table->rise_average = static_cast<float>(sum / kAverageCount);
    if (options_.film == nullptr) return;
    for (size_t c = 0; c < kCount; ++c) {
      table->film_average.push_back(static_cast<float>(film_[c].CosineAverage()));
    }
  }

 private:
  static float MirrorLoss(const FacetShares& side, int i) { return 1 - side.mirror.curve.value[i]; }
  float GlassLoss(const FacetShares& side, int i) const {
    const auto at = [i](const AveragedCurve& c) { return c.curve.value[i]; };
    const float f0 = rise_.f0, rest = 1 - f0;
    const float clear = at(side.mirror) - at(side.total);
    const float reflected = f0 * clear + rest * at(side.rise) + at(side.total);
    const float crossing = rest * (at(side.cross) - at(side.cross_rise));
    return 1 - reflected - crossing;
  }
  template <typename LossAt>
  MuCurve LossOf(const Ggx& ggx, const LossAt& loss_at) const {
    MuCurve loss;
    if (ggx.IsSmooth() || !options_.keeps_energy) return loss;
    for (int i = 0; i < kMuNodeCount; ++i) loss.value[i] = std::max(0.0f, loss_at(i));
    return loss;
  }

  ShareSum<kCount> Visit(const Ggx& ggx, bool within, Vec3f wo, Vec3f m) const {
    ShareSum<kCount> sum;
    const float cosine = std::clamp(Dot(wo, m), 0.0f, 1.0f);
    const float eta = within ? 1 / options_.eta : options_.eta;
    const DielectricFresnel fresnel = FresnelDielectric(cosine, eta);
    const bool is_total = within && !(fresnel.cos_t > 0);
    const float cos_o = within ? std::min(1.0f, fresnel.cos_t) : cosine;
    const auto rise = static_cast<double>(is_total ? 0 : rise_.At(cos_o));
    const auto film_at = [&](size_t c) { return static_cast<double>(film_[c].At(cos_o)); };
    const bool has_film = options_.film != nullptr && !is_total;
    const Vec3f wi = Reflect(wo, m);
    if (wi.z > 0) {
      const double g = ShadowingGivenVisible(ggx, wo, wi);
      sum.mirror = g;
      sum.rise = rise * g;
      sum.schlick = static_cast<double>(SchlickWeight(cosine)) * g;
      if (is_total) sum.total = g;
      for (size_t c = 0; c < kCount && has_film; ++c) sum.film[c] = film_at(c) * g;
    }
    if (!options_.refracts || is_total) return sum;
    const Vec3f wt = Refract(wo, m, cosine, eta, fresnel.cos_t);
    if (!(wt.z < 0)) return sum;
    const double g = ShadowingGivenVisible(ggx, wo, wt);
    sum.cross = g;
    sum.cross_rise = rise * g;
    for (size_t c = 0; c < kCount && has_film; ++c) sum.film_cross[c] = film_at(c) * g;
    return sum;
  }

  FacetShares SharesOf(const Ggx& ggx, bool within, AveragedCurve* schlick) const {
    FacetShares shares;
    const size_t film_count = options_.film != nullptr ? kCount : 0;
    shares.film.resize(film_count);
    shares.film_cross.resize(options_.refracts ? film_count : 0);
    for (int i = 0; i < kMuNodeCount; ++i) {
      const float mu = std::max(MuNode(i), 1e-5f);
      const auto visit = [&](Vec3f wo, Vec3f m) { return Visit(ggx, within, wo, m); };
      const ShareSum<kCount> sum = ggx.IsSmooth()
                                       ? visit({std::sqrt((1 - mu) * (1 + mu)), 0, mu}, {0, 0, 1})
                                       : AverageAtMu(ggx, mu, visit);
      const auto set = [i](AveragedCurve* curve, double value) {
        curve->curve.value[i] = static_cast<float>(value);
      };
      set(&shares.mirror, sum.mirror);
      set(&shares.rise, sum.rise);
      set(&shares.total, sum.total);
      set(&shares.cross, sum.cross);
      set(&shares.cross_rise, sum.cross_rise);
      set(schlick, sum.schlick);
      for (size_t c = 0; c < shares.film.size(); ++c) set(&shares.film[c], sum.film[c]);
      for (size_t c = 0; c < shares.film_cross.size(); ++c) {
        set(&shares.film_cross[c], sum.film_cross[c]);
      }
    }
    const auto average = [](AveragedCurve* curve) {
      curve->average = static_cast<float>(curve->curve.CosineAverage());
    };
    for (AveragedCurve* curve : {&shares.mirror, &shares.rise, &shares.total, &shares.cross,
                                 &shares.cross_rise, schlick}) {
      average(curve);
    }
    for (AveragedCurve& curve : shares.film) average(&curve);
    for (AveragedCurve& curve : shares.film_cross) average(&curve);
    return shares;
  }

  const PrincipledTableOptions options_;
  const FresnelRise rise_;
  const FilmCurves<kCount> film_;
};

template <typename AddRows>
PrincipledTable MakeTable(const PrincipledTableOptions& options, const AddRows& add_rows) {
  PrincipledTable table;
  const auto fill = [&]<size_t kCount>(const RowMaker<kCount>& maker) {
    add_rows(maker, &table.rows);
    maker.SetAverages(&table);
  };
  if (options.film != nullptr && options.spectral) {
    fill(RowMaker<kFilmNodeCount>(options));
  } else {
    fill(RowMaker<3>(options));
  }
  return table;
}

// alpha: kAllAlphas for a table of all.
constexpr Ggx kAllAlphas{-1, -1};

PrincipledTable ComputeTable(const PrincipledTableOptions& options, const Ggx& alpha) {
  return MakeTable(options, [&](const auto& maker, std::vector<PrincipledRow>* rows) {
    if (alpha.alpha_x != kAllAlphas.alpha_x) {
      rows->push_back(maker.Make(alpha));
      return;
    }
    for (int i = 0; i < kAlphaNodeCount; ++i) {
      rows->push_back(maker.Make({AlphaNode(i), AlphaNode(i)}));
    }
  });
}

// Tables of films are not kept: they are rare, and depend on much.
PrincipledTable FindTable(const PrincipledTableOptions& options, const Ggx& alpha) {
  if (options.film != nullptr) return ComputeTable(options, alpha);
  using Key = std::tuple<float, float, float, bool, bool>;
  static auto& made = *new MadeTables<Key, PrincipledTable, kMadeTablesMax>();
  return made.Get(
      {alpha.alpha_x, alpha.alpha_y, options.eta, options.refracts, options.keeps_energy},
      [&] { return ComputeTable(options, alpha); });
}

}  // namespace

PrincipledTable PrincipledTable::Make(const PrincipledTableOptions& options, const Ggx& ggx) {
  return FindTable(options, ggx);
}

PrincipledTable PrincipledTable::MakeForAllAlphas(const PrincipledTableOptions& options) {
  return FindTable(options, kAllAlphas);
}

MuCurve CoatAlbedo(const Ggx& ggx, float eta) {
  MuCurve albedo;
  if (eta == 1) return albedo;
  for (int i = 0; i < kMuNodeCount; ++i) {
    const float mu = std::max(MuNode(i), 1e-5f);
    albedo.value[i] = static_cast<float>(IntegrateInterface(ggx, mu, eta, 0).reflected);
  }
  return albedo;
}

}  // namespace sheaf::render
