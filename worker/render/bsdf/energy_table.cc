// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/energy_table.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "worker/render/bsdf/facet_quadrature.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/made_tables.h"

namespace sheaf::render {
namespace {

struct AlbedoSum {
  InterfaceAlbedo a;
  AlbedoSum& operator+=(const AlbedoSum& b) {
    a.reflected += b.a.reflected;
    a.transmitted += b.a.transmitted;
    a.reflected_attenuated += b.a.reflected_attenuated;
    a.transmitted_attenuated += b.a.transmitted_attenuated;
    return *this;
  }
  AlbedoSum operator*(double s) const {
    return {{a.reflected * s, a.transmitted * s, a.reflected_attenuated * s,
             a.transmitted_attenuated * s}};
  }
};

InterfaceAlbedo IntegrateSmooth(float mu, float eta, double thickness) {
  const DielectricFresnel fresnel = FresnelDielectric(mu, eta);
  InterfaceAlbedo albedo;
  albedo.reflected = fresnel.reflectance;
  albedo.transmitted = 1 - albedo.reflected;
  albedo.reflected_attenuated = albedo.reflected * Attenuation(thickness, mu);
  if (fresnel.cos_t > 0) {
    albedo.transmitted_attenuated = albedo.transmitted * Attenuation(thickness, fresnel.cos_t);
  }
  return albedo;
}

MuCurve MirrorLoss(const Ggx& ggx) {
  MuCurve loss;
  for (int i = 0; i < kMuNodeCount; ++i) {
    const float mu = std::max(MuNode(i), 1e-5f);
    loss.value[i] = static_cast<float>(std::max(0.0, 1 - IntegrateMirror(ggx, mu)));
  }
  return loss;
}

MuCurve InterfaceLoss(const Ggx& ggx, float eta) {
  MuCurve loss;
  for (int i = 0; i < kMuNodeCount; ++i) {
    const float mu = std::max(MuNode(i), 1e-5f);
    const InterfaceAlbedo albedo = IntegrateInterface(ggx, mu, eta, 0);
    loss.value[i] = static_cast<float>(std::max(0.0, 1 - albedo.reflected - albedo.transmitted));
  }
  return loss;
}

// Cosine-weighted average reflectance of a smooth interface from the side of index 1.
double AverageDielectricFresnel(float eta) {
  constexpr int kCount = 512;
  double sum = 0;
  for (int i = 0; i < kCount; ++i) {
    const double mu2 = (i + 0.5) / kCount;
    sum += FresnelDielectric(static_cast<float>(std::sqrt(mu2)), eta).reflectance;
  }
  return sum / kCount;
}

}  // namespace

double MuCurve::CosineAverage() const {
  // Between nodes the value is linear in t = sqrt(mu), and 2 mu dmu = 4 t^3 dt: exact by parts.
  double sum = 0;
  for (int i = 0; i + 1 < kMuNodeCount; ++i) {
    const double t0 = static_cast<double>(i) / (kMuNodeCount - 1);
    const double t1 = static_cast<double>(i + 1) / (kMuNodeCount - 1);
    const double slope = (value[i + 1] - value[i]) / (t1 - t0);
    const double t0_4 = t0 * t0 * t0 * t0, t1_4 = t1 * t1 * t1 * t1;
    sum += (value[i] - slope * t0) * (t1_4 - t0_4) + slope * 0.8 * (t1_4 * t1 - t0_4 * t0);
  }
  return sum;
}

LossLobe LossLobe::Make(const MuCurve& loss) {
  LossLobe lobe;
  lobe.loss = loss;
  lobe.average_loss = static_cast<float>(loss.CosineAverage());
  std::array<double, kMuNodeCount> cumulative{};
  for (int i = 0; i + 1 < kMuNodeCount; ++i) {
    const double width = static_cast<double>(MuNode(i + 1)) * MuNode(i + 1) -
                         static_cast<double>(MuNode(i)) * MuNode(i);
    // A small multiple of the cosine keeps the density above 0 where the loss rounds to 0.
    const double mean = 0.5 * (loss.value[i] + loss.value[i + 1]) + 1e-3 * lobe.average_loss + 1e-9;
    lobe.density[i] = static_cast<float>(mean);
    cumulative[i + 1] = cumulative[i] + mean * width;
  }
  const double total = cumulative.back();
  for (int i = 0; i + 1 < kMuNodeCount; ++i) {
    lobe.density[i] = static_cast<float>(lobe.density[i] / total);
    lobe.cumulative[i + 1] = static_cast<float>(cumulative[i + 1] / total);
  }
  lobe.cumulative.back() = 1;
  return lobe;
}

float LossLobe::SampleMu(float u) const {
  // The last node with cumulative <= u, below the end.
  const auto end = cumulative.begin() + (kMuNodeCount - 1);
  const auto above = std::upper_bound(cumulative.begin() + 1, end, u);
  const auto index = static_cast<int>(above - cumulative.begin()) - 1;
  const float low = cumulative[index], high = cumulative[index + 1];
  const float fraction = high > low ? std::min((u - low) / (high - low), 1.0f) : 0.5f;
  const float mu2_low = MuNode(index) * MuNode(index);
  const float mu2_high = MuNode(index + 1) * MuNode(index + 1);
  return std::max(std::sqrt(mu2_low + fraction * (mu2_high - mu2_low)), 1e-5f);
}

RowBlend FindAlphaRow(float alpha) {
  const float t = std::sqrt(std::clamp(alpha, 0.0f, 1.0f)) * (kAlphaNodeCount - 1);
  const int index = std::min(static_cast<int>(t), kAlphaNodeCount - 2);
  return {index, t - static_cast<float>(index)};
}

double IntegrateMirror(const Ggx& ggx, float mu) {
  return AverageAtMu(ggx, mu, [&](Vec3f wo, Vec3f m) {
    const Vec3f wi = Reflect(wo, m);
    return wi.z > 0 ? ShadowingGivenVisible(ggx, wo, wi) : 0.0;
  });
}

InterfaceAlbedo IntegrateInterface(const Ggx& ggx, float mu, float eta, double thickness) {
  if (ggx.IsSmooth()) return IntegrateSmooth(mu, eta, thickness);
  return AverageAtMu(
             ggx, mu,
             [&](Vec3f wo, Vec3f m) {
               AlbedoSum sum;
               const float cos_i = std::max(0.0f, Dot(wo, m));
               const DielectricFresnel fresnel = FresnelDielectric(cos_i, eta);
               const Vec3f wi = Reflect(wo, m);
               if (wi.z > 0) {
                 sum.a.reflected = fresnel.reflectance * ShadowingGivenVisible(ggx, wo, wi);
                 sum.a.reflected_attenuated = sum.a.reflected * Attenuation(thickness, wi.z);
               }
               if (fresnel.reflectance < 1) {
                 const Vec3f wt = Refract(wo, m, cos_i, eta, fresnel.cos_t);
                 if (wt.z < 0) {
                   sum.a.transmitted =
                       (1 - fresnel.reflectance) * ShadowingGivenVisible(ggx, wo, wt);
                   sum.a.transmitted_attenuated = sum.a.transmitted * Attenuation(thickness, -wt.z);
                 }
               }
               return sum;
             })
      .a;
}

ConductorEnergyRow MakeConductorEnergyRow(const Ggx& ggx) {
  static auto& made = *new MadeTables<std::pair<float, float>, ConductorEnergyRow, kMadeRowsMax>();
  return made.Get({ggx.alpha_x, ggx.alpha_y}, [&] {
    return ConductorEnergyRow{LossLobe::Make(ggx.IsSmooth() ? MuCurve{} : MirrorLoss(ggx))};
  });
}

namespace {

DielectricEnergyRow ComputeDielectricEnergyRow(const Ggx& ggx, float eta) {
  DielectricEnergyRow row;
  row.out = LossLobe::Make(ggx.IsSmooth() ? MuCurve{} : InterfaceLoss(ggx, eta));
  row.in = LossLobe::Make(ggx.IsSmooth() ? MuCurve{} : InterfaceLoss(ggx, 1 / eta));
  // Reciprocity requires transmit_out average_out = eta^2 transmit_in average_in. A smooth
  // interface has 1 - F_out = eta^2 (1 - F_in), so these fractions of the smaller average satisfy
  // it.
  const auto smaller = static_cast<double>(std::min(row.out.average_loss, row.in.average_loss));
  const double crossing = (1 - AverageDielectricFresnel(eta)) * smaller;
  if (row.out.average_loss > 0 && row.in.average_loss > 0) {
    row.transmit_out = static_cast<float>(crossing / row.out.average_loss);
    row.transmit_in =
        static_cast<float>(crossing / (static_cast<double>(eta) * eta * row.in.average_loss));
  }
  return row;
}

}  // namespace

DielectricEnergyRow MakeDielectricEnergyRow(const Ggx& ggx, float eta) {
  using Key = std::tuple<float, float, float>;
  static auto& made = *new MadeTables<Key, DielectricEnergyRow, kMadeRowsMax>();
  return made.Get({ggx.alpha_x, ggx.alpha_y, eta},
                  [&] { return ComputeDielectricEnergyRow(ggx, eta); });
}

std::vector<ConductorEnergyRow> MakeConductorEnergyTable() {
  std::vector<ConductorEnergyRow> rows;
  for (int i = 0; i < kAlphaNodeCount; ++i)
    rows.push_back(MakeConductorEnergyRow({AlphaNode(i), AlphaNode(i)}));
  return rows;
}

std::vector<DielectricEnergyRow> MakeDielectricEnergyTable(float eta) {
  std::vector<DielectricEnergyRow> rows;
  for (int i = 0; i < kAlphaNodeCount; ++i) {
    rows.push_back(MakeDielectricEnergyRow({AlphaNode(i), AlphaNode(i)}, eta));
  }
  return rows;
}

float AverageConductorFresnel(float eta, float k) {
  // Gauss-Legendre over mu with weight 2 mu; the integrand is smooth.
  constexpr std::array<float, 4> kNode = {0.06943184f, 0.33000948f, 0.66999052f, 0.93056816f};
  constexpr std::array<float, 4> kWeight = {0.17392742f, 0.32607258f, 0.32607258f, 0.17392742f};
  float sum = 0;
  for (size_t i = 0; i < kNode.size(); ++i) {
    sum += FresnelConductor(kNode[i], eta, k) * (2 * kNode[i] * kWeight[i]);
  }
  return sum;
}

}  // namespace sheaf::render
