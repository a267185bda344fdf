// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Smooth spectra in [0, 1] of three coefficients, and their fit to linear sRGB: seen under D65 by
// the CIE 1931 observer the spectrum has that RGB. Source: Jakob and Hanika 2019, "A
// Low-Dimensional Function Space for Efficient Spectral Upsampling".
//
// Thread safety: fitting never changes a fitter; any number of threads at once.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

// A spectrum in [0, 1]: 1/2 + x / (2 sqrt(1 + x^2)), x = (c2 t + c1) t + c0, where t is the
// wavelength moved to [0, 1] over [kWavelengthMinNm, kWavelengthMaxNm]. Infinite coefficients are
// not used: 0 and 1 come from a large c0.
struct SigmoidSpectrum {
  float c0 = 0, c1 = 0, c2 = 0;

  float At(float nm) const {
    const float t = (nm - kWavelengthMinNm) * (1 / (kWavelengthMaxNm - kWavelengthMinNm));
    const float x = (c2 * t + c1) * t + c0;
    // The value at -|x|, free of the cancellation that would leave a dark colour a few bits.
    const float squared = 1 + x * x;
    const float low = 0.5f / (squared + std::fabs(x) * std::sqrt(squared));
    // low or 1 - low, without a branch, so that four wavelengths take one vector instruction each.
    const float sign = std::copysign(1.f, x);
    return 0.5f * (1 + sign) - sign * low;
  }
  Spectral At(const Wavelengths& wavelengths) const {
    Spectral values;
    for (size_t i = 0; i < kWavelengthCount; ++i) values[i] = At(wavelengths.nm[i]);
    return values;
  }
};

// Fits spectra; holds the quadrature.
class SigmoidFitter {
 public:
  using Coefficients = std::array<double, 3>;  // c0, c1, c2.

  // step_nm: distance of the quadrature's points; twice it divides the range. The spectrum is taken
  // to be a parabola through each three of them; what it is weighted with keeps its own steps. 1 nm
  // is exact; 5 nm takes a fifth of the time and is off by at most 5e-4, for the most saturated
  // red.
  explicit SigmoidFitter(int step_nm);

  // Coefficients of the spectrum whose RGB is rgb, or is as close to it as such spectra come.
  // Requires: components in [0, 1], not all 0 and not all 1.
  Coefficients Fit(Rgb rgb) const;
  // As Fit, starting from the coefficients of a similar colour.
  Coefficients FitFrom(Rgb rgb, const Coefficients& start) const;

  // Linear sRGB of a spectrum under D65.
  std::array<double, 3> RgbUnderD65(const Coefficients& c) const;

 private:
  // A point of the quadrature and what a reflectance of 1 there adds to each channel.
  struct Node {
    double t;
    std::array<double, 3> weight;
  };
  // How far a spectrum is from the wanted colour, relative to that colour's largest component.
  struct Residual {
    std::array<double, 3> value{};
    std::array<std::array<double, 3>, 3> derivative{};  // [channel][coefficient].
    double squared = 0;
  };
  Residual Evaluate(Rgb rgb, const Coefficients& c) const;

  std::vector<Node> nodes_;
};

// Coefficients of the constant spectrum: c1 = c2 = 0. Clamped to [0, 1].
SigmoidFitter::Coefficients FitGrey(double value);

// The spectrum of a reflectance, fitted to rgb itself (some tens of microseconds). Components are
// clamped to [0, 1]. What no such spectrum reaches (close to the gamut's edges) is approached.
SigmoidSpectrum FitSigmoid(Rgb rgb);
// The same for a colour outside of the gamut of sRGB, which spectra do reach: components may be
// negative or above 1.
SigmoidSpectrum FitSigmoidOutOfGamut(Rgb rgb);

}  // namespace sheaf::render
