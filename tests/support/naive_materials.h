// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Common formulas of materials in single precision. docs/hard-cases.md says for each row where the
// formula breaks down; tests record their results beside the expected values (hard_case.h).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "common/math/vec.h"

namespace sheaf::naive {

inline constexpr float kPi = std::numbers::pi_v<float>;

// M1: the GGX distribution of normals from the cosine alone.
inline float GgxD(float alpha, float cosine) {
  const float a2 = alpha * alpha;
  const float d = cosine * cosine * (a2 - 1) + 1;
  return a2 / (kPi * d * d);
}

// M2, M3, A3: the weight of a direction reflected by a rough mirror whose normal m is sampled from
// D cos, single scattering with Smith's G2: unbounded at grazing angles. 0 if the direction is
// below the surface.
inline float WeightByDistribution(float alpha, Vec3f wo, float u, float v) {
  const float tan2 = alpha * alpha * u / (1 - u), z = 1 / std::sqrt(1 + tan2);
  const float r = std::sqrt(1 - z * z);
  const Vec3f m{r * std::cos(2 * kPi * v), r * std::sin(2 * kPi * v), z};
  const float along = Dot(wo, m);
  const Vec3f wi = m * (2 * along) - wo;
  if (along <= 0 || wi.z <= 0) return 0;
  const auto lambda = [alpha](float cosine) {
    const float tan2_of = (1 - cosine * cosine) / (cosine * cosine);
    return (std::sqrt(1 + alpha * alpha * tan2_of) - 1) / 2;
  };
  return along / (wo.z * m.z) / (1 + lambda(wo.z) + lambda(wi.z));
}

// M2, A3: the fraction of the light along wo that single scattering by a rough mirror of
// reflectance 1 keeps.
inline float SingleScattering(float alpha, Vec3f wo) {
  constexpr int kSide = 512;
  float sum = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const float u = (static_cast<float>(i / kSide) + 0.5f) / kSide;
    const float v = (static_cast<float>(i % kSide) + 0.5f) / kSide;
    sum += WeightByDistribution(alpha, wo, u, v);
  }
  return sum / (kSide * kSide);
}

// M4: the reflectance of a dielectric of relative index eta.
inline float FresnelDielectric(float cosine, float eta) {
  const float sine = std::sqrt(1 - cosine * cosine) / eta;
  const float inner = std::sqrt(1 - sine * sine);
  const float parallel = (eta * cosine - inner) / (eta * cosine + inner);
  const float across = (cosine - eta * inner) / (cosine + eta * inner);
  return (parallel * parallel + across * across) / 2;
}

// M5: the cosine between wo and the half vector of a transmission.
inline float TransmissionCosine(Vec3f wo, Vec3f wi, float eta) {
  const Vec3f sum = wo + wi * eta;
  return Dot(wo, sum * (1 / std::sqrt(Dot(sum, sum))));
}

// M7: the reflectance of a conductor with a given reflectance at normal incidence.
inline float ConductorOfReflectance(float reflectance) {
  const float k = 2 * std::sqrt(reflectance) / std::sqrt(1 - reflectance);
  return k * k / (4 + k * k);
}

// M8: transmittance of two interfaces of relative index n in a single pass.
inline float SlabInOnePass(float n) {
  const float r = (n - 1) / (n + 1);
  return (1 - r * r) * (1 - r * r);
}

// M9: the deviation in degrees of the symmetric path through a prism of 60 degrees, by cosines.
inline float PrismDeviation(float n) {
  const float cosine = std::sqrt(1 - 0.25f * n * n);
  return (2 * std::acos(cosine) - kPi / 3) * 180 / kPi;
}

// M10: the length of the normal that a texel encodes.
inline float TexelNormalLength(Vec3f texel) {
  const Vec3f d = texel * 2 - Vec3f{1, 1, 1};
  const Vec3f n = d * (1 / std::sqrt(Dot(d, d)));
  return std::sqrt(Dot(n, n));
}

// M11: the cosine of a direction sampled by Henyey and Greenstein's formula.
inline float HenyeyGreensteinCosine(float g, float u) {
  const float part = (1 - g * g) / (1 - g + 2 * g * u);
  return (1 + g * g - part * part) / (2 * g);
}

// M12: the longitudinal lobe of a fiber for variance v at equal angles on both sides.
inline float HairLobe(float v, float sine, float cosine) {
  const float x = cosine * cosine / v;
  const float bessel = std::exp(x) / std::sqrt(2 * kPi * x);
  return std::exp(-sine * sine / v) * bessel / (2 * v * std::sinh(1 / v));
}

// M14: the sigmoid of a spectrum's polynomial.
inline float Sigmoid(float x) { return 0.5f + x / (2 * std::sqrt(1 + x * x)); }

}  // namespace sheaf::naive
