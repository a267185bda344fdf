// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ThinFilm: interference in a film of constant thickness on a dielectric or metal. Light that
// crosses the film m times is delayed by m times the optical path difference; the reflectance is a
// series in m of cosines of that phase. Per wavelength the series has a closed form; for RGB each
// cosine is integrated over the observer's sensitivities, which are sums of Gaussians, and so is
// its Fourier transform. Polarizations are averaged at each interface. Sources: Belcour and Barla
// 2017, "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence";
// KHR_materials_iridescence (the same for a base of given reflectance).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/math/elementary.h"
#include "worker/render/bsdf/fresnel.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

struct ThinFilm {
  float eta = 1.3f;  // At least 1: no total reflection from outside.
  float thickness_nm = 400;
};

// Fresnel reflectance by Schlick's formula. Source: Schlick 1994, "An Inexpensive BRDF Model for
// Physically-based Rendering".
inline float SchlickWeight(float cosine) {
  const float x = std::clamp(1 - cosine, 0.0f, 1.0f), x2 = x * x;
  return x2 * x2 * x;
}

// The mean of cos(2 pi path / wavelength + shift) over the sensitivities of linear sRGB, relative
// to path and shift 0, so that white stays white. Source: Belcour and Barla 2017, sec. 4, and the
// fit of KHR_materials_iridescence.
inline Rgb MeanCosine(float path_nm, float shift) {
  struct Gaussian {
    float value, position, variance;
  };
  // The last one is added to X.
  constexpr Gaussian kGaussians[] = {{5.4856e-13f, 1.6810e6f, 4.3278e9f},
                                     {4.4201e-13f, 1.7953e6f, 9.3046e9f},
                                     {5.2481e-13f, 2.2084e6f, 6.6121e9f},
                                     {9.7470e-14f, 2.2399e6f, 4.5282e9f}};
  constexpr float kArea = 1.0685e-7f;  // The integral of each sensitivity.
  const float two_pi = 2 * static_cast<float>(kPi);
  const float phase = two_pi * path_nm * 1e-9f;
  float xyz[4];
  for (size_t i = 0; i < 4; ++i) {
    const Gaussian& g = kGaussians[i];
    xyz[i] = g.value / kArea * std::sqrt(two_pi * g.variance) * Cos(g.position * phase + shift) *
             Exp(-g.variance * phase * phase);
  }
  const float x = xyz[0] + xyz[3], y = xyz[1], z = xyz[2];
  // XYZ to linear sRGB (IEC 61966-2-1), over the sRGB of X = Y = Z = 1.
  return {(3.2404542f * x - 1.5371385f * y - 0.4985314f * z) * (1 / 1.2047843f),
          (-0.9692660f * x + 1.8760108f * y + 0.0415560f * z) * (1 / 0.9483008f),
          (0.0556434f * x - 0.2040259f * y + 1.0572252f * z) * (1 / 0.9088427f)};
}

// One film over one base, for light of one direction. base: reflectance between film and base.
struct FilmOrders {
  float first = 0;   // R12 + Rs: the mean over phases.
  float factor = 0;  // The term of order m is factor * ratio^m * cos.
  float ratio = 0;
};
inline FilmOrders OrdersOf(float outside, float base) {
  const float entering = 1 - outside;
  const float both = std::min(outside * base, 0.9999f);
  const float sum = entering * entering * base / (1 - both);
  return {outside + sum, 2 * (sum - entering), std::sqrt(both)};
}

// The sums over orders m >= 1 of ratio^m times the cosine of m times path and turn.
inline Rgb PhaseSums(const Rgb& base, float outside, float path_nm, const Rgb& turn, const Rgb&) {
  constexpr int kOrderMax = 3;  // ratio^4 is below 0.01 for films of index 2 and less.
  Rgb sum, power = Rgb::Gray(1);
  for (int m = 1; m <= kOrderMax; ++m) {
    const float order = static_cast<float>(m);
    const Rgb cosine = MeanCosine(order * path_nm, order * turn[0]);
    for (size_t c = 0; c < 3; ++c) {
      power[c] *= OrdersOf(outside, base[c]).ratio;
      sum[c] += power[c] *
                (turn[c] == turn[0] ? cosine[c] : MeanCosine(order * path_nm, order * turn[c])[c]);
    }
  }
  return sum;
}
inline Spectral PhaseSums(const Spectral& base, float outside, float path_nm, const Spectral& turn,
                          const Spectral& nm) {
  return MakeColor<Spectral>([&](size_t c) {
    const float cosine = Cos(2 * static_cast<float>(kPi) * path_nm / nm[c] + turn[c]);
    const float r = OrdersOf(outside, base[c]).ratio;
    return r * (cosine - r) / (1 - 2 * r * cosine + r * r);
  });
}

// Reflectance of a film on a base, whose reflectance below the film, and shift of the phase there
// (0 or pi), are given by component. cos_o: cosine outside. nm: wavelengths; unused for RGB.
template <typename Color>
Color FilmReflectance(const ThinFilm& film, float cos_o, const Color& base, const Color& shift,
                      const Color& nm) {
  const DielectricFresnel outer = FresnelDielectric(cos_o, film.eta);
  const float path_nm = 2 * film.eta * film.thickness_nm * outer.cos_t;
  const Color turn = shift + Color::Gray(static_cast<float>(kPi));
  const Color sum = PhaseSums(base, outer.reflectance, path_nm, turn, nm);
  return MakeColor<Color>([&](size_t c) {
    const FilmOrders orders = OrdersOf(outer.reflectance, base[c]);
    return std::clamp(orders.first + orders.factor * sum[c], 0.0f, 1.0f);
  });
}

// The film on a dielectric of index eta.
template <typename Color>
Color FilmOnDielectric(const ThinFilm& film, float cos_o, float eta, const Color& nm) {
  const float cos_film = std::min(1.0f, FresnelDielectric(cos_o, film.eta).cos_t);
  const float base = FresnelDielectric(cos_film, eta / film.eta).reflectance;
  const float shift = eta < film.eta ? static_cast<float>(kPi) : 0.0f;
  return FilmReflectance(film, cos_o, Color::Gray(base), Color::Gray(shift), nm);
}

// The film on a metal that reflects f0 at normal incidence without it.
template <typename Color>
Color FilmOnMetal(const ThinFilm& film, float cos_o, const Color& f0, const Color& nm) {
  constexpr float kReflectanceMax = 0.9999f;  // Its index is 4e4.
  const float cos_film = std::min(1.0f, FresnelDielectric(cos_o, film.eta).cos_t);
  const float grazing = SchlickWeight(cos_film);
  const auto index_of = [&](size_t c) {
    const float root = std::sqrt(std::clamp(f0[c], 0.0f, kReflectanceMax));
    return (1 + root) / (1 - root);
  };
  const Color base = MakeColor<Color>([&](size_t c) {
    if (f0[c] >= 1) return 1.0f;
    const float n = index_of(c), root = (n - film.eta) / (n + film.eta);
    return root * root + (1 - root * root) * grazing;
  });
  const Color shift = MakeColor<Color>(
      [&](size_t c) { return index_of(c) < film.eta ? static_cast<float>(kPi) : 0.0f; });
  return FilmReflectance(film, cos_o, base, shift, nm);
}

}  // namespace sheaf::render
