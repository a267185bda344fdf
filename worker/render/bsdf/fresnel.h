// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Fresnel reflectance of unpolarized light at smooth interfaces, in forms that stay accurate at
// grazing incidence and at the critical angle.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/math/vec.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

struct DielectricFresnel {
  float reflectance = 1;
  float cos_t = 0;  // Cosine of refraction, >= 0; 0 under total internal reflection.
};

// cos_i: cosine of incidence, in [0, 1]. eta: index of the far side over that of the near side.
// cos^2 of the refracted angle is formed from cos_i alone, ((eta - 1)(eta + 1) + cos_i^2) / eta^2:
// no 1 - sin^2, so nothing cancels at grazing incidence, and eta = 1 gives exactly 0.
// Source: Born and Wolf, Principles of Optics, sec. 1.5.2.
inline DielectricFresnel FresnelDielectric(float cos_i, float eta) {
  const float cos2_t_eta2 = (eta - 1) * (eta + 1) + cos_i * cos_i;
  if (!(cos2_t_eta2 > 0)) return {};
  const float cos_t_eta = std::sqrt(cos2_t_eta2);  // eta * cos_t.
  const float cos_t = cos_t_eta / eta;
  const float r_parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  const float r_perpendicular = (cos_i - cos_t_eta) / (cos_i + cos_t_eta);
  return {0.5f * (r_parallel * r_parallel + r_perpendicular * r_perpendicular), cos_t};
}

// k at and above which a conductor reflects everything; keeps k * k far from overflow.
inline constexpr float kPerfectConductorK = 1e8f;

// Conductor of complex index eta + i k against vacuum. cos_i in [0, 1].
// Source: Born and Wolf, sec. 14.2, with the square roots of the complex cosine written out.
inline float FresnelConductor(float cos_i, float eta, float k) {
  if (k >= kPerfectConductorK) return 1;
  const float cos2 = cos_i * cos_i;
  const float sin2 = std::max(0.0f, (1 - cos_i) * (1 + cos_i));
  const float t = eta * eta - k * k - sin2;
  const float a2_plus_b2 = std::sqrt(t * t + 4 * eta * eta * k * k);
  const float two_a_cos = 2 * cos_i * std::sqrt(std::max(0.0f, 0.5f * (a2_plus_b2 + t)));
  const float s_sum = a2_plus_b2 + cos2;
  if (!(s_sum + two_a_cos > 0)) return 1;
  const float r_s = (s_sum - two_a_cos) / (s_sum + two_a_cos);
  const float p_sum = cos2 * a2_plus_b2 + sin2 * sin2;
  const float p_difference = two_a_cos * sin2;
  // At normal incidence p_sum and a may both be tiny: both polarizations are equal there.
  const float r_p =
      p_sum + p_difference > 0 ? r_s * (p_sum - p_difference) / (p_sum + p_difference) : r_s;
  return 0.5f * (r_s + r_p);
}
template <typename Color>
Color FresnelConductor(float cos_i, const Color& eta, const Color& k) {
  return MakeColor<Color>([&](size_t i) { return FresnelConductor(cos_i, eta[i], k[i]); });
}

}  // namespace sheaf::render
