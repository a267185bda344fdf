// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Ggx: the GGX (Trowbridge-Reitz) distribution of microfacet normals with Smith's height-correlated
// shadowing. All formulas use the tangential components of directions and
//   s(w) = sqrt((alpha_x w.x)^2 + (alpha_y w.y)^2 + w.z^2),
// never tan or 1 - cos^2, so that alpha = 1e-3 and cosines of 1e-4 lose no digits. In terms of s,
// Smith's functions are quotients of sums of positive numbers:
//   Lambda(w) = (s/|w.z| - 1) / 2,  G1(w) = 2 |w.z| / (|w.z| + s),
//   G2(o, i) = 2 |o.z| |i.z| / (s(o) |i.z| + s(i) |o.z|).
// Sources: Walter et al. 2007; Heitz 2014, "Understanding the Masking-Shadowing Function"; Heitz
// 2018, "Sampling the GGX Distribution of Visible Normals"; Dupuy and Benyoub 2023, "Sampling
// Visible GGX Normals with Spherical Caps".
#pragma once

#include <algorithm>
#include <cmath>

#include "common/math/elementary.h"
#include "common/math/vec.h"

namespace sheaf::render {

// Below this alpha the lobe is narrower than float directions resolve, and a surface counts as
// smooth: its lobes are delta distributions. The same limit as pbrt-v4's.
inline constexpr float kSmoothAlpha = 1e-3f;

struct Ggx {
  float alpha_x = 1, alpha_y = 1;

  bool IsSmooth() const { return alpha_x < kSmoothAlpha && alpha_y < kSmoothAlpha; }

  // Density of microfacet area per area and solid angle. Requires: m is unit length, m.z >= 0.
  float D(Vec3f m) const {
    const float x = m.x / alpha_x, y = m.y / alpha_y;
    const float e = x * x + y * y + m.z * m.z;
    return 1 / (static_cast<float>(kPi) * alpha_x * alpha_y * e * e);
  }
  float S(Vec3f w) const {
    const float x = alpha_x * w.x, y = alpha_y * w.y;
    return std::sqrt(x * x + y * y + w.z * w.z);
  }
  // G2 / (4 |o.z| |i.z|), without the division by vanishing cosines.
  float G2Over4Cos(Vec3f o, Vec3f i) const {
    return 0.5f / (S(o) * std::fabs(i.z) + S(i) * std::fabs(o.z));
  }

  // Samples a microfacet normal (z >= 0) as seen from w, by the spherical cap that is the visible
  // hemisphere in the space where the surface is a sphere. Requires: w.z >= 0.
  Vec3f SampleVisibleNormal(Vec3f w, Vec2f u) const {
    const Vec3f stretched{w.x * alpha_x, w.y * alpha_y, w.z};
    const float length2 = LengthSquared(stretched);
    const Vec3f v = length2 > 0 ? stretched * (1 / std::sqrt(length2)) : Vec3f{0, 0, 1};
    const float z = (1 - u.y) * (1 + v.z) - v.z;
    // 1 - z^2 as a product: 1 - z = u.y (1 + v.z), with no cancellation near the pole.
    const float sin_theta = std::sqrt(std::max(0.0f, u.y * (1 + v.z) * (1 + z)));
    const SinCosPair<float> phi = SinCos(2 * static_cast<float>(kPi) * u.x);
    const Vec3f cap{sin_theta * phi.cos, sin_theta * phi.sin, z};
    const Vec3f h = cap + v;
    const Vec3f m{h.x * alpha_x, h.y * alpha_y, std::max(0.0f, h.z)};
    const float m_length2 = LengthSquared(m);
    return m_length2 > 0 ? m * (1 / std::sqrt(m_length2)) : Vec3f{0, 0, 1};
  }
};

// The mirror image of w about m.
inline Vec3f Reflect(Vec3f w, Vec3f m) { return 2 * Dot(w, m) * m - w; }

// The refracted direction of w through a facet m on w's side (Dot(w, m) = cos_i > 0). eta: index of
// the far side over the near side; cos_t as FresnelDielectric gives it.
inline Vec3f Refract(Vec3f w, Vec3f m, float cos_i, float eta, float cos_t) {
  const float scale = 1 / eta;
  return (cos_i * scale - cos_t) * m - scale * w;
}

}  // namespace sheaf::render
