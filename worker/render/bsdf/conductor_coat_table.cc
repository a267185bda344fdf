// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/bsdf/conductor_coat_table.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "worker/render/bsdf/facet_quadrature.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/made_tables.h"

namespace sheaf::render {
namespace {

// Light inside the coat is binned by cosine: equal steps of its square, so that a Lambertian source
// fills all bins equally.
constexpr int kBinCount = 64;
// Maximum passes of the chain's iterative solution. Each pass multiplies the error by the fraction
// of light that returns to the base, 0.6 for a coat of index 1.5.
constexpr int kPassCountMax = 2000;
constexpr double kChangeMin = 1e-9;

struct Spread {
  std::array<double, kBinCount> energy{};

  void Add(double mu, double amount) {
    energy[static_cast<size_t>(std::min(static_cast<int>(mu * mu * kBinCount), kBinCount - 1))] +=
        amount;
  }
  double Sum() const {
    double sum = 0;
    for (const double x : energy) sum += x;
    return sum;
  }
  void Scale(double factor) {
    for (double& x : energy) x *= factor;
  }
  double Dot(const Spread& other) const {
    double sum = 0;
    for (size_t i = 0; i < kBinCount; ++i) sum += energy[i] * other.energy[i];
    return sum;
  }
};
float NodeMu(size_t node) { return std::max(MuNode(static_cast<int>(node)), 1e-5f); }
Ggx Isotropic(const Ggx& ggx) { return {EquivalentAlpha(ggx), EquivalentAlpha(ggx)}; }
double BinMu(size_t bin) { return std::sqrt((static_cast<double>(bin) + 0.5) / kBinCount); }

// Calls visit(wo, m, weight) for the facets visible at a cosine, with weights that sum to 1.
// Requires: ggx is isotropic.
template <typename Visit>
void ForEachFacet(const Ggx& ggx, double mu, Visit visit) {
  const auto cosine = static_cast<float>(mu);
  const Vec3f wo{std::sqrt((1 - cosine) * (1 + cosine)), 0, cosine};
  ForEachLatticeNormal(ggx, wo, [&](Vec3f m, double weight) { visit(wo, m, weight); });
}

// The result of one interaction with the interface.
struct AtInterface {
  Spread reflected, transmitted;
};
AtInterface ScatterAtInterface(const Ggx& ggx, double mu, float eta) {
  AtInterface scattered;
  if (ggx.IsSmooth()) {
    const DielectricFresnel fresnel = FresnelDielectric(static_cast<float>(mu), eta);
    scattered.reflected.Add(mu, fresnel.reflectance);
    if (fresnel.reflectance < 1)
      scattered.transmitted.Add(fresnel.cos_t, 1.0 - fresnel.reflectance);
    return scattered;
  }
  ForEachFacet(ggx, mu, [&](Vec3f wo, Vec3f m, double weight) {
    const float cos_i = std::max(0.0f, Dot(wo, m));
    const DielectricFresnel fresnel = FresnelDielectric(cos_i, eta);
    const Vec3f wi = Reflect(wo, m);
    if (wi.z > 0) {
      scattered.reflected.Add(wi.z,
                              weight * fresnel.reflectance * ShadowingGivenVisible(ggx, wo, wi));
    }
    if (!(fresnel.reflectance < 1)) return;
    const Vec3f wt = Refract(wo, m, cos_i, eta, fresnel.cos_t);
    if (wt.z < 0) {
      scattered.transmitted.Add(
          -wt.z, weight * (1.0 - fresnel.reflectance) * ShadowingGivenVisible(ggx, wo, wt));
    }
  });
  return scattered;
}

Spread ScatterAtBase(const Ggx& ggx, double mu) {
  Spread scattered;
  if (ggx.IsSmooth()) {
    scattered.Add(mu, 1);
    return scattered;
  }
  ForEachFacet(ggx, mu, [&](Vec3f wo, Vec3f m, double weight) {
    const Vec3f wi = Reflect(wo, m);
    if (wi.z > 0) scattered.Add(wi.z, weight * ShadowingGivenVisible(ggx, wo, wi));
  });
  return scattered;
}

// The layers as a Markov chain. Roughness is isotropic here: anisotropic roughness is replaced by
// its mean square slope.
class Chain {
 public:
  Chain(const Ggx& interface, const Ggx& base, float eta, float thickness, bool keeps_energy,
        double entered_average)
      : keeps_energy_(keeps_energy) {
    double escape_average = 0;
    for (size_t i = 0; i < kBinCount; ++i) {
      const double mu = BinMu(i);
      attenuation_.energy[i] = Attenuation(thickness, mu);
      AtInterface scattered = ScatterAtInterface(interface, mu, 1 / eta);
      back_[i] = scattered.reflected;
      escape_.energy[i] = scattered.transmitted.Sum();
      escape_average += escape_.energy[i] / kBinCount;
      scattered_[i] = ScatterAtBase(base, mu);
      loss_.energy[i] = std::max(0.0, 1 - scattered_[i].Sum());
    }
    average_loss_ = loss_.Sum() / kBinCount;
    if (keeps_energy) KeepEnergy(eta, escape_average, entered_average);
  }

  // For each bin, the fraction that leaves the coat after one reflection at a white base.
  Spread EscapingOnce() const {
    Spread up;
    for (size_t k = 0; k < kBinCount; ++k)
      up.energy[k] = attenuation_.energy[k] * escape_.energy[k];
    Spread down;
    for (size_t j = 0; j < kBinCount; ++j) {
      down.energy[j] = attenuation_.energy[j] * scattered_[j].Dot(up);
    }
    return down;
  }

  // For each bin, the fraction of light going down from the interface that leaves the coat, over a
  // base of this reflectance. `known` is the starting point of the iteration.
  Spread Escaping(double reflectance, const Spread& known) const {
    const double tint = keeps_energy_ && average_loss_ > 0
                            ? static_cast<double>(TintOfReturn(static_cast<float>(reflectance),
                                                               static_cast<float>(average_loss_))) /
                                  (kBinCount * average_loss_)
                            : 0;
    Spread down = known;
    for (int pass = 0; pass < kPassCountMax; ++pass) {
      Spread up;  // The fraction of light going up from the base, per bin, that leaves.
      for (size_t k = 0; k < kBinCount; ++k) {
        up.energy[k] = attenuation_.energy[k] * (escape_.energy[k] + back_[k].Dot(down));
      }
      const double of_lost = tint * loss_.Dot(up);
      double change = 0;
      for (size_t j = 0; j < kBinCount; ++j) {
        const double next = attenuation_.energy[j] *
                            (reflectance * scattered_[j].Dot(up) + loss_.energy[j] * of_lost);
        change = std::max(change, std::fabs(next - down.energy[j]));
        down.energy[j] = next;
      }
      if (change < kChangeMin) break;
    }
    return down;
  }

 private:
  // All light that is not reflected gets out, and by reciprocity 1 / eta^2 of the fraction that
  // gets in, on average: the loss of single scattering goes where that leaves room.
  void KeepEnergy(float eta, double escape_average, double entered_average) {
    const double wanted = entered_average / (static_cast<double>(eta) * eta);
    const double scale = escape_average > 0 ? wanted / escape_average : 0;
    for (size_t i = 0; i < kBinCount; ++i) {
      escape_.energy[i] = std::min(1.0, scale * escape_.energy[i]);
      const double sum = back_[i].Sum();
      if (sum > 0) {
        back_[i].Scale((1 - escape_.energy[i]) / sum);
      } else {
        back_[i].energy[i] = 1 - escape_.energy[i];
      }
    }
  }

  bool keeps_energy_;
  Spread attenuation_, escape_, loss_;
  std::array<Spread, kBinCount> back_{}, scattered_{};
  double average_loss_ = 0;
};

// Sets the parts of the highlight's lobe. For a facet tilt t, refraction turns directions inside
// the coat by (1 - cos / (eta cos')) t, with the cosines outside and inside, and a reflecting facet
// by 2 t; the interface is crossed twice.
void SetLobeThroughInterface(const Ggx& interface, const Ggx& base, float eta,
                             ConductorCoatRow* row) {
  constexpr float kPower = 4.0f / 3;
  const auto width = [](float alpha) { return Pow(std::max(alpha, kLobeAlphaMin), kPower); };
  const bool is_smooth = interface.IsSmooth();
  row->base_width = {width(base.alpha_x), width(base.alpha_y)};
  // Shadowing hides the steepest facets of a rough interface. The factor agrees best with walks.
  const auto seen = [](float alpha) { return alpha / (1 + 4 * alpha * alpha); };
  row->interface_width = {is_smooth ? 0 : width(seen(interface.alpha_x)),
                          is_smooth ? 0 : width(seen(interface.alpha_y))};
  for (size_t i = 0; i < kMuNodeCount; ++i) {
    // Grazing light sees facets that face it.
    const float node = NodeMu(i);
    const float mu = Isotropic(interface).S({std::sqrt((1 - node) * (1 + node)), 0, node});
    const float inside = FresnelDielectric(mu, eta).cos_t;
    const float turn = inside > 0 ? std::fabs(1 - mu / (eta * inside)) / 2 : 0;
    row->bend.value[i] = turn > 0 ? Pow(turn, kPower) : 0;
  }
}

// Light reflected repeatedly at the base, seen from outside, where refraction has widened its
// distribution. The factors are those that agree best with random walks over roughness and angle.
Ggx LobeOfRest(const Ggx& interface, const Ggx& base, float eta) {
  constexpr float kOfBase = 2.25f, kOfInterface = 0.6f;
  const float alpha =
      eta * (kOfBase * EquivalentAlpha(base) + kOfInterface * EquivalentAlpha(interface));
  return {std::clamp(alpha, kSmoothAlpha, 1.0f), std::clamp(alpha, kSmoothAlpha, 1.0f)};
}

double TintNode(int node) {
  const double left = 1 - static_cast<double>(node) / (kTintNodeCount - 1);
  return 1 - left * left;
}

// Values by reflectance of the base, at the tint nodes.
struct ByReflectance {
  std::array<double, kTintNodeCount> value{};
  ByReflectance& operator+=(const ByReflectance& other) {
    for (size_t i = 0; i < kTintNodeCount; ++i) value[i] += other.value[i];
    return *this;
  }
  ByReflectance operator*(double factor) const {
    ByReflectance scaled = *this;
    for (double& x : scaled.value) x *= factor;
    return scaled;
  }
};

// Albedo of the highlight for light that leaves at cosine mu: the integral of part 2. returns:
// whether to include the series of internal reflections.
ByReflectance IntegrateHighlight(const ConductorCoatRow& row, float mu, float eta, bool returns) {
  const float inner_mu = FresnelDielectric(mu, eta).cos_t;
  if (!(inner_mu > 0)) return {};
  const MuPosition o = FindMu(mu);
  const auto enter_o = static_cast<double>(row.enter.At(o));
  const auto reflect_o = static_cast<double>(row.reflect.At(o));
  const float bend_o = row.bend.At(o);
  const Ggx lobe = row.LobeAt(bend_o, bend_o);
  const auto through_facet = [&](Vec3f wo, Vec3f m) {
    ByReflectance of_facet;
    const Vec3f wi = Reflect(wo, m);
    if (!(wi.z > 0)) return of_facet;
    const float mu_i = FresnelDielectric(std::min(wi.z, 1.0f), 1 / eta).cos_t;
    if (!(mu_i > 0)) return of_facet;
    const MuPosition i = FindMu(mu_i);
    const Ggx between = row.LobeAt(bend_o, row.bend.At(i));
    const double other_lobe = static_cast<double>(between.D(m)) / static_cast<double>(lobe.D(m)) *
                              static_cast<double>(between.G2Over4Cos(wo, wi)) /
                              static_cast<double>(lobe.G2Over4Cos(wo, wi));
    const double once = enter_o * static_cast<double>(row.enter.At(i)) * other_lobe *
                        ShadowingGivenVisible(lobe, wo, wi);
    const double attenuation = Attenuation(row.thickness, wo.z) * Attenuation(row.thickness, wi.z);
    const double again = returns ? std::min(reflect_o, static_cast<double>(row.reflect.At(i))) : 0;
    for (int n = 0; n < kTintNodeCount; ++n) {
      const double kept = TintNode(n) * attenuation;
      of_facet.value[static_cast<size_t>(n)] =
          once * kept / std::max(1 - again * kept, static_cast<double>(kSeriesMin));
    }
    return of_facet;
  };
  return AverageOverIncidence(lobe, inner_mu, [&](Vec3f wo) {
    ByReflectance sum;
    ForEachLatticeNormal(lobe, wo,
                         [&](Vec3f m, double weight) { sum += through_facet(wo, m) * weight; });
    return sum;
  });
}

// Light that has just entered, by the node of its cosine of incidence.
using Entered = std::array<Spread, kMuNodeCount>;

// Sets R, T and the distribution of entered light.
void ScatterFromOutside(const Ggx& interface, float eta, bool keeps_energy, ConductorCoatRow* row,
                        Entered* entered) {
  for (size_t i = 0; i < kMuNodeCount; ++i) {
    const float mu = NodeMu(i);
    const InterfaceAlbedo outside = IntegrateInterface(interface, mu, eta, 0);
    double enters = keeps_energy ? 1 - outside.reflected : outside.transmitted;
    if (!(outside.transmitted > 0)) enters = 0;
    row->reflect.value[i] = static_cast<float>(outside.reflected);
    row->enter.value[i] = static_cast<float>(enters);
    Spread& spread = (*entered)[i];
    spread = ScatterAtInterface(Isotropic(interface), mu, eta).transmitted;
    const double sum = spread.Sum();
    if (sum > 0) spread.Scale(enters / sum);
  }
}

// A rough interface reflects more light back into the coat than its mean facet does: lowers T until
// the highlight has the energy that leaves the chain after one reflection.
void FitHighlight(const Chain& chain, const Entered& entered, float eta, ConductorCoatRow* row) {
  constexpr int kFitCount = 4;
  const MuCurve most = row->enter;
  const Spread once = chain.EscapingOnce();
  for (int fit = 0; fit < kFitCount; ++fit) {
    MuCurve next = row->enter;
    for (size_t i = 0; i < kMuNodeCount; ++i) {
      const double has = IntegrateHighlight(*row, NodeMu(i), eta, false).value.back();
      if (!(has > 0)) continue;
      // Half of the correction: the other half applies to the direction on the other side.
      const double factor = std::sqrt(entered[i].Dot(once) / has);
      next.value[i] = std::min(static_cast<float>(next.value[i] * factor), most.value[i]);
    }
    row->enter = next;
  }
}

// Returns the curve s for which s(o) s(i) times a GGX mirror lobe has this albedo at every angle.
// By Sinkhorn's scaling of a symmetric kernel: a solution exists for any positive lobe.
MuCurve FitRestLobe(const Ggx& ggx, const MuCurve& albedo) {
  constexpr int kScaleCount = 200;
  // Fraction of light from node o that leaves at node i: directions are split between their two
  // nodes.
  static_assert(kMuNodeCount <= kBinCount);
  std::array<Spread, kMuNodeCount> kernel;
  for (size_t o = 0; o < kMuNodeCount; ++o) {
    ForEachFacet(ggx, NodeMu(o), [&](Vec3f wo, Vec3f m, double weight) {
      const Vec3f wi = Reflect(wo, m);
      if (!(wi.z > 0)) return;
      const MuPosition at = FindMu(wi.z);
      const double energy = weight * ShadowingGivenVisible(ggx, wo, wi);
      const auto first = static_cast<size_t>(at.index);
      kernel[o].energy[first] += energy * (1.0 - at.fraction);
      kernel[o].energy[first + 1] += energy * at.fraction;
    });
  }
  Spread scale;
  for (size_t i = 0; i < kMuNodeCount; ++i) {
    scale.energy[i] = std::sqrt(static_cast<double>(albedo.value[i]));
  }
  for (int pass = 0; pass < kScaleCount; ++pass) {
    Spread next;
    for (size_t o = 0; o < kMuNodeCount; ++o) {
      const double has = scale.energy[o] * kernel[o].Dot(scale);
      // Half of the correction: the other half applies to the direction on the other side.
      if (has > 0) {
        next.energy[o] = scale.energy[o] * std::sqrt(static_cast<double>(albedo.value[o]) / has);
      }
    }
    scale = next;
  }
  MuCurve fitted;
  for (size_t i = 0; i < kMuNodeCount; ++i) fitted.value[i] = static_cast<float>(scale.energy[i]);
  return fitted;
}

// Sets part 3, the light outside the highlight.
void SetRest(const Chain& chain, const Entered& entered, float eta, ConductorCoatRow* row) {
  std::array<MuCurve, kTintNodeCount> total, highlight;
  Spread escaping;
  for (size_t n = 0; n < kTintNodeCount; ++n) {
    escaping = chain.Escaping(TintNode(static_cast<int>(n)), escaping);
    for (size_t i = 0; i < kMuNodeCount; ++i) {
      total[n].value[i] = static_cast<float>(entered[i].Dot(escaping));
    }
  }
  MuCurve rest;
  for (size_t i = 0; i < kMuNodeCount; ++i) {
    const ByReflectance part = IntegrateHighlight(*row, NodeMu(i), eta, true);
    for (size_t n = 0; n < kTintNodeCount; ++n) {
      highlight[n].value[i] = static_cast<float>(part.value[n]);
    }
    rest.value[i] = std::max(0.0f, total.back().value[i] - highlight.back().value[i]);
  }
  row->highlight = highlight.back();
  row->rest_albedo = rest;
  row->rest = FitRestLobe(row->rest_lobe, rest);
  const double rest_average = rest.CosineAverage();
  for (size_t n = 0; n < kTintNodeCount; ++n) {
    const double left = total[n].CosineAverage() - highlight[n].CosineAverage();
    row->tint[n] =
        rest_average > 0 ? static_cast<float>(std::clamp(left / rest_average, 0.0, 1.0)) : 0;
  }
}

}  // namespace

float ConductorCoatRow::Tint(float reflectance) const {
  const float r = std::fmin(std::fmax(reflectance, 0.0f), 1.0f);
  const float t = (1 - std::sqrt(1 - r)) * (kTintNodeCount - 1);
  const int index = std::min(static_cast<int>(t), kTintNodeCount - 2);
  const float low = tint[static_cast<size_t>(index)], high = tint[static_cast<size_t>(index) + 1];
  return low + (t - static_cast<float>(index)) * (high - low);
}

namespace {

ConductorCoatRow ComputeConductorCoatRow(const Ggx& interface, const Ggx& base, float eta,
                                         float thickness, bool keeps_energy) {
  ConductorCoatRow row;
  row.thickness = thickness;
  row.is_smooth = interface.IsSmooth() && base.IsSmooth();
  if (row.is_smooth) return row;
  SetLobeThroughInterface(interface, base, eta, &row);
  row.rest_lobe = LobeOfRest(interface, base, eta);
  Entered entered;
  ScatterFromOutside(interface, eta, keeps_energy, &row, &entered);
  const Chain chain(Isotropic(interface), Isotropic(base), eta, thickness, keeps_energy,
                    row.enter.CosineAverage());
  if (!interface.IsSmooth()) FitHighlight(chain, entered, eta, &row);
  SetRest(chain, entered, eta, &row);
  return row;
}

}  // namespace

ConductorCoatRow MakeConductorCoatRow(const Ggx& interface, const Ggx& base, float eta,
                                      float thickness, bool keeps_energy) {
  using Key = std::tuple<float, float, float, float, float, float, bool>;
  static auto& made = *new MadeTables<Key, ConductorCoatRow, kMadeRowsMax>();
  return made.Get(
      {interface.alpha_x, interface.alpha_y, base.alpha_x, base.alpha_y, eta, thickness,
       keeps_energy},
      [&] { return ComputeConductorCoatRow(interface, base, eta, thickness, keeps_energy); });
}

}  // namespace sheaf::render
