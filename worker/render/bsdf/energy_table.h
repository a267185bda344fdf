// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Energy that single scattering loses on rough surfaces, tabulated over the cosine of incidence,
// and the lobes that return it. Smith's model drops shadowed light, which in reality scatters
// again; at alpha = 1 a GGX mirror keeps only 31 % at normal incidence. The lost part is returned
// as a separate lobe, f(o, i) = c loss(o) loss(i) / (pi average loss), which is reciprocal and
// conserves energy exactly. Sources: Kelemen and Szirmay-Kalos 2001; Kulla and Conty 2017,
// "Revisiting Physically Based Shading at Imageworks" (also for the pair of lobes of a dielectric).
//
// Tables are made by quadrature over visible normals when a scene is compiled, with the same bits
// on every machine. A row belongs to one alpha; for textured roughness there is one row for each of
// kAlphaNodeCount alphas, and a lookup blends two neighbors.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/bsdf/microfacet.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

inline constexpr int kMuNodeCount = 64;     // Nodes at cos = (i / 63)^2: dense where curves bend.
inline constexpr int kAlphaNodeCount = 33;  // Nodes at alpha = (i / 32)^2.

// Position of a cosine between the nodes.
struct MuPosition {
  int index = 0;       // In [0, kMuNodeCount - 2].
  float fraction = 0;  // In [0, 1].
};
inline MuPosition FindMu(float mu) {
  const float t = std::sqrt(std::min(1.0f, std::max(0.0f, mu))) * (kMuNodeCount - 1);
  const int index = t < kMuNodeCount - 2 ? static_cast<int>(t) : kMuNodeCount - 2;
  return {index, t - static_cast<float>(index)};
}
constexpr float MuNode(int index) {
  const float t = static_cast<float>(index) / (kMuNodeCount - 1);
  return t * t;
}

// A function of the cosine in [0, 1], piecewise linear between the nodes.
struct MuCurve {
  std::array<float, kMuNodeCount> value{};

  float At(MuPosition p) const {
    return value[p.index] + p.fraction * (value[p.index + 1] - value[p.index]);
  }
  // 2 * integral of At(mu) mu dmu over [0, 1]: the cosine-weighted average over a hemisphere.
  double CosineAverage() const;
};

// A loss curve that can be sampled: directions with density close to loss(mu) mu.
struct LossLobe {
  MuCurve loss;
  float average_loss = 0;                         // loss.CosineAverage().
  std::array<float, kMuNodeCount - 1> density{};  // Over mu^2, constant between nodes.
  std::array<float, kMuNodeCount> cumulative{};   // 0 at the first node, 1 at the last.

  static LossLobe Make(const MuCurve& loss);
  // Pdf in solid angle of SampleMu with a uniform azimuth.
  float Pdf(MuPosition p, float mu) const {
    return density[p.index] * mu * static_cast<float>(1 / kPi);
  }
  // Samples a cosine in (0, 1]. u in [0, 1).
  float SampleMu(float u) const;
};

// One alpha of a conductor (the loss does not depend on its index; color is applied separately).
struct ConductorEnergyRow {
  LossLobe lobe;
};

// One alpha of a dielectric interface. out: light arriving on the side of index 1 (+z), in: on the
// other side. transmit_*: fraction of the returned energy that crosses, chosen so that the lobes
// satisfy f(i, o) / eta_o^2 = f(o, i) / eta_i^2.
struct DielectricEnergyRow {
  LossLobe out, in;
  float transmit_out = 0, transmit_in = 0;
};

// Two neighboring rows, and the fraction between them; fraction 0 for constant roughness.
struct RowBlend {
  int index = 0;
  float fraction = 0;
};
RowBlend FindAlphaRow(float alpha);  // alpha in [0, 1]; larger ones give the last row.
constexpr float AlphaNode(int index) {
  const float t = static_cast<float>(index) / (kAlphaNodeCount - 1);
  return t * t;
}

// With anisotropic roughness the loss is averaged over azimuths: energy is conserved on average
// over them, and the lobe stays reciprocal. eta: index of the -z side over that of the +z side, not
// 1.
ConductorEnergyRow MakeConductorEnergyRow(const Ggx& ggx);
DielectricEnergyRow MakeDielectricEnergyRow(const Ggx& ggx, float eta);
// The isotropic alpha for a table of all nodes: equal mean square slope.
inline float EquivalentAlpha(const Ggx& ggx) {
  return std::sqrt(0.5f * (ggx.alpha_x * ggx.alpha_x + ggx.alpha_y * ggx.alpha_y));
}

// All alpha nodes, for textured roughness.
std::vector<ConductorEnergyRow> MakeConductorEnergyTable();
std::vector<DielectricEnergyRow> MakeDielectricEnergyTable(float eta);

// Albedos of one interaction with a rough dielectric interface, from the side of index 1.
struct InterfaceAlbedo {
  double reflected = 0, transmitted = 0;
  // The same, weighted by exp(-thickness / |cos|) of the direction it leaves in.
  double reflected_attenuated = 0, transmitted_attenuated = 0;
};
// mu: cosine of incidence, > 0; averaged over azimuths. eta: far side over near side. Smooth where
// ggx.IsSmooth().
InterfaceAlbedo IntegrateInterface(const Ggx& ggx, float mu, float eta, double thickness);
// Single-scattering albedo of a perfectly reflecting rough mirror.
double IntegrateMirror(const Ggx& ggx, float mu);

// Tint of the energy that repeated reflection returns. average: cosine-weighted Fresnel
// reflectance; loss: average loss of the lobe, with the same weight. Shadowed light has been
// reflected once, and is reflected again each time it fails to leave. Source: Hill 2018, "A
// Multi-Faceted Exploration", part 3.
inline float TintOfReturn(float average, float loss) {
  return average * average * (1 - loss) / (1 - average * loss);
}

// Cosine-weighted average of the Fresnel reflectance.
float AverageConductorFresnel(float eta, float k);
template <typename Color>
Color AverageConductorFresnel(const Color& eta, const Color& k) {
  return MakeColor<Color>([&](size_t i) { return AverageConductorFresnel(eta[i], k[i]); });
}

}  // namespace sheaf::render
