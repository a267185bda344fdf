// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Spectral, Wavelengths: the color that a path carries is RGB, or radiance at four wavelengths of
// its own. A trait (kSpectral) selects, so that transport is compiled for each, and a scene whose
// colors need no spectra samples no wavelength. The four are the primary wavelength and three at
// equal steps of the sampling density, so each alone has the primary's distribution: a path that
// must follow one of them (dispersion) terminates the secondary wavelengths and multiplies the
// primary's value by four. Sources: Wilkie et al. 2014, "Hero Wavelength Spectral Sampling";
// Radziszewski et al. 2009 for the density.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "common/math/elementary.h"
#include "common/math/vec.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

inline constexpr size_t kWavelengthCount = 4;
inline constexpr float kWavelengthMinNm = 360, kWavelengthMaxNm = 830;

// A value at each of a path's wavelengths, with the same operations as Rgb, so that transport code
// is generic over both.
struct Spectral {
  std::array<float, kWavelengthCount> v{};

  static constexpr Spectral Gray(float x) { return {{x, x, x, x}}; }
  constexpr float operator[](size_t i) const { return v[i]; }
  constexpr float& operator[](size_t i) { return v[i]; }
  friend constexpr Spectral operator+(const Spectral& p, const Spectral& q) {
    return {{p.v[0] + q.v[0], p.v[1] + q.v[1], p.v[2] + q.v[2], p.v[3] + q.v[3]}};
  }
  friend constexpr Spectral operator*(const Spectral& p, const Spectral& q) {
    return {{p.v[0] * q.v[0], p.v[1] * q.v[1], p.v[2] * q.v[2], p.v[3] * q.v[3]}};
  }
  friend constexpr Spectral operator*(const Spectral& p, float s) { return p * Gray(s); }
  friend constexpr Spectral operator*(float s, const Spectral& p) { return p * Gray(s); }
  friend constexpr Spectral operator/(const Spectral& p, float s) {
    return {{p.v[0] / s, p.v[1] / s, p.v[2] / s, p.v[3] / s}};
  }
  constexpr Spectral& operator+=(const Spectral& q) { return *this = *this + q; }
  constexpr Spectral& operator*=(const Spectral& q) { return *this = *this * q; }
  constexpr Spectral& operator*=(float s) { return *this = *this * s; }
  constexpr bool IsBlack() const { return v[0] == 0 && v[1] == 0 && v[2] == 0 && v[3] == 0; }
  friend constexpr bool operator==(const Spectral&, const Spectral&) = default;
};
constexpr float MaxComponent(const Spectral& c) {
  const float low = c.v[0] > c.v[1] ? c.v[0] : c.v[1], high = c.v[2] > c.v[3] ? c.v[2] : c.v[3];
  return low > high ? low : high;
}
// Number of components of a color, Rgb or Spectral.
template <typename Color>
inline constexpr size_t kComponentCount = sizeof(Color) / sizeof(float);
// The color with components f(0), f(1) ...
template <typename Color, typename Function>
constexpr Color MakeColor(const Function& f) {
  Color color;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) color[i] = f(i);
  return color;
}
inline bool IsFinite(const Spectral& c) {
  return std::isfinite(c.v[0]) && std::isfinite(c.v[1]) && std::isfinite(c.v[2]) &&
         std::isfinite(c.v[3]);
}

// The wavelengths of one path.
struct Wavelengths {
  std::array<float, kWavelengthCount> nm{};   // In [kWavelengthMinNm, kWavelengthMaxNm].
  std::array<float, kWavelengthCount> pdf{};  // Density per nm with which each was sampled.

  float hero_nm() const { return nm[0]; }
  // u in [0, 1). Density proportional to sech^2(0.0072 (nm - 538)), close to the eye's sensitivity.
  static Wavelengths Sample(float u);
  // The same at one of them. position: in [0, 1).
  static float NmAt(float position) {
    const float tanh = TanhAt(position);
    const float nm = kCenterNm + 0.5f / kSteepness * Log((1 + tanh) / (1 - tanh));
    return std::fmin(std::fmax(nm, kWavelengthMinNm), kWavelengthMaxNm);
  }
  static float PdfAt(float position) {
    const float tanh = TanhAt(position);
    return kSteepness / kSpan * (1 - tanh) * (1 + tanh);
  }
  // The density at any wavelength of the range.
  static float PdfOf(float nm) {
    const float e = Exp(2 * kSteepness * (nm - kCenterNm));
    return kSteepness / kSpan * 4 * e / ((1 + e) * (1 + e));
  }

 private:
  static constexpr float kCenterNm = 538, kSteepness = 0.0072f;
  // Tanh of kSteepness (nm - kCenterNm) at the ends of the range.
  static constexpr float kTanhMin = -0.856910625469828f, kTanhMax = 0.9705913469402698f;
  static constexpr float kSpan = kTanhMax - kTanhMin;
  static float TanhAt(float position) { return kTanhMin + kSpan * position; }
};

inline Wavelengths Wavelengths::Sample(float u) {
  Wavelengths w;
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    float position = u + static_cast<float>(i) / kWavelengthCount;
    if (position >= 1) position -= 1;
    w.nm[i] = NmAt(position);
    w.pdf[i] = PdfAt(position);
  }
  return w;
}

// The wavelengths of a path that carries RGB: none.
struct NoWavelengths {};

template <TraitBits kTraits>
using ColorOf = std::conditional_t<Has(kTraits, Trait::kSpectral), Spectral, Rgb>;
template <typename Color>
using WavelengthsOf =
    std::conditional_t<std::is_same_v<Color, Spectral>, Wavelengths, NoWavelengths>;

}  // namespace sheaf::render
