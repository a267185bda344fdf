// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Light at a hair: a dielectric cylinder with tilted scales and an absorbing inside. Light is
// reflected (R), goes through (TT), is reflected once inside (TRT), or more often; each is a lobe
// along the fibre times one around it, both normalised, so that a fibre without absorption scatters
// all light. Sources: Marschner et al. 2003, "Light Scattering from Human Hair Fibers"; d'Eon et
// al. 2011, "An Energy-Conserving Hair Reflectance Model"; Chiang et al. 2016, "A Practical and
// Controllable Hair and Fur Model", whose parameters these are.
//
// The fibre runs along +x; nothing depends on how y and z lie around it. theta: angle to the plane
// across the fibre; phi: azimuth in it. The model is not reciprocal (its lobes' energy depends on
// wo alone).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

#include "common/math/elementary.h"
#include "worker/render/bsdf/bsdf.h"
#include "worker/render/bsdf/bsdf_sampling.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/bsdf/lobe.h"

namespace sheaf::render {

// R, TT, TRT and all others, which have no direction of their own around the fibre.
inline constexpr size_t kHairLobeCount = 4;
// The least beta_m and beta_n: lobes of lower roughness would be delta lobes to floats. pbrt-v4
// has the same floor.
inline constexpr float kHairBetaMin = 0.01f;

// Variance along the fibre of the first lobe, for beta_m in [0, 1]. Source: Chiang et al., eq. 7.
inline float HairVariance(float beta_m) {
  const double b = static_cast<double>(beta_m), b5 = b * b * b * b * b;
  const double root = 0.726 * b + 0.812 * b * b + 3.7 * (b5 * b5 * b5 * b5);
  return static_cast<float>(root * root);
}
// Scale of the logistic distribution around the fibre, for beta_n in [0, 1]. Source: eq. 8.
inline float HairLogisticScale(float beta_n) {
  const double b = static_cast<double>(beta_n), b11 = Pow(b, 11.0);
  constexpr double kSqrtOfPiOver8 = 0.6266570686577501;
  return static_cast<float>(kSqrtOfPiOver8 * (0.265 * b + 1.194 * b * b + 5.372 * (b11 * b11)));
}
// Divides the logarithm of what a head of such hair reflects by light that went through many of
// them; the quotient's square is the absorption. Source: eq. 9.
inline float HairReflectanceScale(float b) {
  return 5.969f + b * (-0.215f + b * (2.532f + b * (-10.73f + b * (5.574f + b * 0.245f))));
}
inline float HairAbsorption(float reflectance, float beta_n) {
  constexpr float kReflectanceMin = 1e-20f;  // Black enough, and its logarithm is finite.
  const float c = reflectance < kReflectanceMin ? kReflectanceMin : reflectance;
  const float root = Log(c) / HairReflectanceScale(beta_n);
  return root * root;
}

// e^-x I0(x), the modified Bessel function of order 0 without its growth; x >= 0. Relative error
// below 4e-7. Source: Abramowitz and Stegun, 9.8.1 and 9.8.2.
inline float ScaledBesselI0(float x) {
  constexpr float kBend = 3.75f;
  if (x < kBend) {
    const float t = (x / kBend) * (x / kBend);
    return Exp(-x) *
           (1 +
            t * (3.5156229f +
                 t * (3.0899424f +
                      t * (1.2067492f + t * (0.2659732f + t * (0.0360768f + t * 0.0045813f))))));
  }
  const float t = kBend / x;
  float sum = 0.00392377f;
  for (const float c : {-0.01647633f, 0.02635537f, -0.02057706f, 0.00916281f, -0.00157565f,
                        0.00225319f, 0.01328592f, 0.39894228f}) {
    sum = sum * t + c;
  }
  return sum / std::sqrt(x);
}

// One way of light through the fibre, for a given wo.
struct FiberLobe {
  float sin_o, cos_o;  // The angle of wo to the cross-section, turned by this lobe's scales.
  float variance;
  float phi;  // Where around the fibre, from wo, light leaves that is not spread.

  // Density over theta, in cos(theta) d(theta), of d'Eon et al., eq. 7. All exponents are taken
  // together, to half the square of a distance, so that nothing grows and nothing cancels however
  // small the variance.
  float AlongPdf(float sin_i, float cos_i) const {
    const float across = cos_i - cos_o, along = sin_i + sin_o;
    const float exponent = 0.5f * (across * across + along * along) / variance;
    return Exp(-exponent) * ScaledBesselI0(cos_i * cos_o / variance) /
           (-Expm1(-2 / variance) * variance);
  }
};

// The logistic distribution on [-pi, pi]; scale > 0.
inline float TrimmedLogisticMass(float scale) {  // tanh(pi / (2 scale))
  const float e = -static_cast<float>(kPi) / scale;
  return -Expm1(e) / (1 + Exp(e));
}
inline float TrimmedLogisticPdf(float x, float scale) {
  const float e = Exp(-std::fabs(x) / scale);
  return e / (scale * (1 + e) * (1 + e) * TrimmedLogisticMass(scale));
}
// By the area hyperbolic tangent of a number near 0 in the middle, so that the tails are alike.
inline float SampleTrimmedLogistic(float u, float scale) {
  const float w = (2 * u - 1) * TrimmedLogisticMass(scale);
  const float pi = static_cast<float>(kPi);
  if (!(w > -1)) return -pi;
  if (!(w < 1)) return pi;
  return std::clamp(scale * Log((1 + w) / (1 - w)), -pi, pi);
}
// To [-pi, pi].
inline float WrapAngle(float x) {
  const float two_pi = 2 * static_cast<float>(kPi);
  return x - two_pi * std::floor(x / two_pi + 0.5f);
}

// The scattering of light by a fibre towards wo.
template <typename Color>
struct HairPaths {
  std::array<FiberLobe, kHairLobeCount> lobes;
  std::array<Color, kHairLobeCount> energy;       // Sums to 1 without absorption.
  std::array<float, kHairLobeCount> probability;  // With which lobes are sampled.
  float phi_o = 0;
  float scale = 0;  // Scale of the logistic distribution.

  BsdfValueOf<Color> Eval(Vec3f wi) const {
    const float cos_i = std::sqrt(wi.y * wi.y + wi.z * wi.z);
    const float phi = Atan2(wi.z, wi.y) - phi_o;
    BsdfValueOf<Color> value;
    for (size_t p = 0; p < kHairLobeCount; ++p) {
      const float around = p + 1 == kHairLobeCount
                               ? static_cast<float>(0.5 / kPi)
                               : TrimmedLogisticPdf(WrapAngle(phi - lobes[p].phi), scale);
      const float density = lobes[p].AlongPdf(wi.x, cos_i) * around;
      value.f_cos += energy[p] * density;
      value.pdf += probability[p] * density;
    }
    return value;
  }
};

// Sines and cosines of wo's angle as each lobe's scales turn it: by -2, 1 and 4 times the tilt.
inline void SetHairTilts(float sin_o, float cos_o, float sin_tilt,
                         std::array<FiberLobe, kHairLobeCount>* lobes) {
  std::array<float, 3> s, c;  // Sines and cosines of 1, 2 and 4 times the tilt.
  s[0] = sin_tilt;
  c[0] = std::sqrt(std::fmax(0.0f, (1 - sin_tilt) * (1 + sin_tilt)));
  for (size_t i = 1; i < 3; ++i) {
    s[i] = 2 * s[i - 1] * c[i - 1];
    c[i] = (c[i - 1] - s[i - 1]) * (c[i - 1] + s[i - 1]);
  }
  const auto turn = [&](size_t lobe, float sin_by, float cos_by) {
    (*lobes)[lobe].sin_o = sin_o * cos_by + cos_o * sin_by;
    // Turned beyond the fibre's direction it is the same angle on the other side.
    (*lobes)[lobe].cos_o = std::fabs(cos_o * cos_by - sin_o * sin_by);
  };
  turn(0, -s[1], c[1]);
  turn(1, s[0], c[0]);
  turn(2, s[2], c[2]);
  turn(3, 0, 1);
}

template <typename Color>
HairPaths<Color> MakeHairPaths(const BsdfOf<Color>& bsdf, Vec3f wo) {
  HairPaths<Color> paths;
  const float h = bsdf.hair.offset, eta = bsdf.eta;
  const float cos_o = std::sqrt(wo.y * wo.y + wo.z * wo.z);
  paths.phi_o = Atan2(wo.z, wo.y);
  paths.scale = bsdf.alpha_y;
  SetHairTilts(wo.x, cos_o, bsdf.hair.sin_tilt, &paths.lobes);
  // eta times the cosine of theta inside, without 1 - sin^2; the floor is for light along a fibre
  // of index 1 or less.
  const float eta_cos_t = std::sqrt(std::fmax((eta - 1) * (eta + 1) + cos_o * cos_o, 1e-12f));
  const float sin_gamma_t = std::clamp(h * cos_o / eta_cos_t, -1.0f, 1.0f);
  const float gamma_o = Asin(h), gamma_t = Asin(sin_gamma_t);
  constexpr float kVarianceRatio[kHairLobeCount] = {1, 0.25f, 4, 4};
  for (size_t p = 0; p < kHairLobeCount; ++p) {
    const float order = static_cast<float>(p);
    paths.lobes[p].variance = kVarianceRatio[p] * bsdf.alpha_x;
    paths.lobes[p].phi = 2 * order * gamma_t - 2 * gamma_o + order * static_cast<float>(kPi);
  }
  const float cos_gamma_o = std::sqrt((1 - h) * (1 + h));
  const float reflected = FresnelDielectric(std::fmin(cos_o * cos_gamma_o, 1.0f), eta).reflectance;
  const float entering = 1 - reflected;
  const float length = 2 * std::sqrt((1 - sin_gamma_t) * (1 + sin_gamma_t)) * eta / eta_cos_t;
  float sum = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) {
    const float inside = Exp(-bsdf.color[i] * length);
    const float again = inside * reflected;
    paths.energy[0][i] = reflected;
    paths.energy[1][i] = entering * entering * inside;
    paths.energy[2][i] = paths.energy[1][i] * again;
    // The rest of a geometric series. At an edge all is reflected, and nothing is left to divide.
    paths.energy[3][i] =
        paths.energy[2][i] > 0 ? paths.energy[2][i] * again / (1 - again) : paths.energy[2][i];
  }
  for (size_t p = 0; p < kHairLobeCount; ++p) {
    paths.probability[p] = 0;
    for (size_t i = 0; i < kComponentCount<Color>; ++i) {
      paths.probability[p] += paths.energy[p][i];
    }
    sum += paths.probability[p];
  }
  for (float& probability : paths.probability) probability = sum > 0 ? probability / sum : 0;
  return paths;
}

struct HairLobe : LobeBase {
  using Material = HairMaterial;
  static constexpr BsdfKind kKind = BsdfKind::kHair;
  static constexpr TraitBits kTraits = TraitSet(Trait::kHair);
  static constexpr bool kHasSides = false;
  static constexpr bool kTransmits = true;

  template <typename Color>
  static BsdfValueOf<Color> f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool /*inside*/);

  template <typename Color>
  static std::optional<BsdfSampleOf<Color>> Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                     float u_lobe, Vec2f u, bool /*inside*/);

  template <typename Color>
  static float PDF(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool inside) {
    return f(bsdf, wo, wi, inside).pdf;
  }
};

template <typename Color>
BsdfValueOf<Color> HairLobe::f(const BsdfOf<Color>& bsdf, Vec3f wo, Vec3f wi, bool /*inside*/) {
  return MakeHairPaths(bsdf, wo).Eval(wi);
}

template <typename Color>
std::optional<BsdfSampleOf<Color>> HairLobe::Sample_f(const BsdfOf<Color>& bsdf, Vec3f wo,
                                                      float u_lobe, Vec2f u, bool /*inside*/) {
  const HairPaths<Color> paths = MakeHairPaths(bsdf, wo);
  // The number that chooses the lobe is spent again around the fibre.
  size_t p = 0;
  while (p + 1 < kHairLobeCount && u_lobe >= paths.probability[p]) {
    u_lobe -= paths.probability[p++];
  }
  if (!(paths.probability[p] > 0)) return std::nullopt;
  const float u_around = std::fmin(u_lobe / paths.probability[p], 0x1.fffffep-1f);
  const FiberLobe& lobe = paths.lobes[p];
  // About the cone's own axis, by 1 - cos, which keeps its digits where the lobe is narrow.
  // Source: d'Eon et al. 2013, "Importance Sampling for Physically-Based Hair Fiber Models".
  const float versine =
      std::clamp(-lobe.variance * Log1p(u.x * Expm1(-2 / lobe.variance)), 0.0f, 2.0f);
  const float cos_cone = 1 - versine, sin_cone = std::sqrt(versine * (2 - versine));
  const SinCosPair<float> turn = SinCos(2 * static_cast<float>(kPi) * u.y);
  const float sin_i = sin_cone * turn.cos * lobe.cos_o - cos_cone * lobe.sin_o;
  const float across = sin_cone * turn.cos * lobe.sin_o + cos_cone * lobe.cos_o;
  const float beside = sin_cone * turn.sin;
  const float cos_i = std::sqrt(across * across + beside * beside);
  const float around = p + 1 == kHairLobeCount
                           ? 2 * static_cast<float>(kPi) * u_around
                           : lobe.phi + SampleTrimmedLogistic(u_around, paths.scale);
  const SinCosPair<float> phi = SinCos(paths.phi_o + around);
  const Vec3f wi = Normalize(Vec3f{sin_i, cos_i * phi.cos, cos_i * phi.sin});
  return FinishSample(paths.Eval(wi), wi, kBsdfTransmission);
}

}  // namespace sheaf::render
