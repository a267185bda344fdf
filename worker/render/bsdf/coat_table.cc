// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/coat_table.h"

#include <algorithm>
#include <tuple>

#include "worker/render/bsdf/facet_quadrature.h"
#include "worker/render/bsdf/made_tables.h"

namespace sheaf::render {
namespace {

// Steps in mu^2 of the integral for K. Smooth interfaces have a square-root edge at the critical
// angle and are cheap to evaluate; rough ones are smooth functions but expensive.
constexpr int kSmoothStepCount = 4096;
constexpr int kRoughStepCount = 64;

// K where multiple scattering in rough interfaces is lost.
double LossyRecapture(const Ggx& ggx, float eta, double thickness) {
  const int count = ggx.IsSmooth() ? kSmoothStepCount : kRoughStepCount;
  double recapture = 0;
  for (int i = 0; i < count; ++i) {
    const double mu = std::sqrt((i + 0.5) / count);
    const InterfaceAlbedo inside =
        IntegrateInterface(ggx, static_cast<float>(mu), 1 / eta, thickness);
    recapture += Attenuation(thickness, mu) * inside.reflected_attenuated / count;
  }
  return recapture;
}

// K. entered_average: cosine-weighted average, from outside, of the light that is not reflected.
double Recapture(const Ggx& ggx, float eta, double thickness, double entered_average) {
  const int count = ggx.IsSmooth() ? kSmoothStepCount : kRoughStepCount;
  std::vector<InterfaceAlbedo> inside(count);
  std::vector<double> up(count);
  double escape_average = 0;
  for (int i = 0; i < count; ++i) {
    const double mu = std::sqrt((i + 0.5) / count);
    inside[i] = IntegrateInterface(ggx, static_cast<float>(mu), 1 / eta, thickness);
    up[i] = Attenuation(thickness, mu);
    escape_average += inside[i].transmitted / count;
  }
  // Reciprocity: on average, the fraction that gets out is 1 / eta^2 of the fraction that gets in.
  const double wanted = entered_average / (static_cast<double>(eta) * eta);
  const double scale = escape_average > 0 ? wanted / escape_average : 0;
  double recapture = 0;
  for (int i = 0; i < count; ++i) {
    if (!(inside[i].reflected > 0)) continue;
    const double down = inside[i].reflected_attenuated / inside[i].reflected;
    recapture += up[i] * std::max(0.0, 1 - scale * inside[i].transmitted) * down / count;
  }
  return recapture;
}

CoatRow ComputeCoatRow(const Ggx& ggx, float eta, float thickness, bool keeps_energy) {
  CoatRow row;
  MuCurve entered;
  for (int i = 0; i < kMuNodeCount; ++i) {
    const float mu = std::max(MuNode(i), 1e-5f);
    const InterfaceAlbedo outside = IntegrateInterface(ggx, mu, eta, thickness);
    const double not_reflected = 1 - outside.reflected;
    const double reaches_base =
        outside.transmitted > 0 ? outside.transmitted_attenuated / outside.transmitted : 0;
    row.reflect.value[i] = static_cast<float>(outside.reflected);
    entered.value[i] = static_cast<float>(not_reflected);
    row.enter.value[i] = static_cast<float>(keeps_energy ? not_reflected * reaches_base
                                                         : outside.transmitted_attenuated);
  }
  row.enter_average = static_cast<float>(row.enter.CosineAverage());
  row.recapture =
      static_cast<float>(keeps_energy ? Recapture(ggx, eta, thickness, entered.CosineAverage())
                                      : LossyRecapture(ggx, eta, thickness));
  return row;
}

}  // namespace

CoatRow MakeCoatRow(const Ggx& ggx, float eta, float thickness, bool keeps_energy) {
  using Key = std::tuple<float, float, float, float, bool>;
  static auto& made = *new MadeTables<Key, CoatRow, kMadeRowsMax>();
  return made.Get({ggx.alpha_x, ggx.alpha_y, eta, thickness, keeps_energy},
                  [&] { return ComputeCoatRow(ggx, eta, thickness, keeps_energy); });
}

std::vector<CoatRow> MakeCoatTable(float eta, float thickness, bool keeps_energy) {
  std::vector<CoatRow> rows;
  for (int i = 0; i < kAlphaNodeCount; ++i) {
    rows.push_back(MakeCoatRow({AlphaNode(i), AlphaNode(i)}, eta, thickness, keeps_energy));
  }
  return rows;
}

}  // namespace sheaf::render
