// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Smooth spectra in [0, 1] with three coefficients, and their fit to linear sRGB: under D65 the CIE
// 1931 observer sees the given RGB. Source: Jakob and Hanika 2019, "A Low-Dimensional Function
// Space for Efficient Spectral Upsampling".
//
// Thread safety: fitting does not modify a fitter; any number of threads at once.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

// A spectrum in [0, 1]: 1/2 + x / (2 sqrt(1 + x^2)), x = (c2 t + c1) t + c0, where t is the
// wavelength normalized to [0, 1] over [kWavelengthMinNm, kWavelengthMaxNm]. Coefficients are
// finite: 0 and 1 result from a large c0.
struct SigmoidSpectrum {
  float c0 = 0, c1 = 0, c2 = 0;

  float At(float nm) const {
    const float t = (nm - kWavelengthMinNm) * (1 / (kWavelengthMaxNm - kWavelengthMinNm));
    const float x = (c2 * t + c1) * t + c0;
    // The value at -|x|, without the cancellation that would leave dark colors only a few bits.
    const float squared = 1 + x * x;
    const float low = 0.5f / (squared + std::fabs(x) * std::sqrt(squared));
    // low or 1 - low, branch-free, so that four wavelengths use vector instructions.
    const float sign = std::copysign(1.f, x);
    return 0.5f * (1 + sign) - sign * low;
  }
  Spectral At(const Wavelengths& wavelengths) const {
    Spectral values;
    for (size_t i = 0; i < kWavelengthCount; ++i) values[i] = At(wavelengths.nm[i]);
    return values;
  }
};

// Fits spectra; stores the quadrature.
class SigmoidFitter {
 public:
  using Coefficients = std::array<double, 3>;  // c0, c1, c2.

  // step_nm: spacing of the quadrature points; twice it divides the range. The spectrum is
  // interpolated by a parabola through each three points; its weights keep their own steps. 1 nm is
  // exact; 5 nm takes a fifth of the time and has an error of at most 5e-4, for the most saturated
  // red.
  explicit SigmoidFitter(int step_nm);

  // Returns the coefficients of the spectrum whose RGB is closest to rgb; equal where possible.
  // Requires: components in [0, 1], not all 0 and not all 1.
  Coefficients Fit(Rgb rgb) const;
  // As Fit, starting from the coefficients of a similar color.
  Coefficients FitFrom(Rgb rgb, const Coefficients& start) const;

 private:
  // A quadrature point, and the contribution of reflectance 1 there to each channel.
  struct Node {
    double t;
    std::array<double, 3> weight;
  };
  // Difference of a spectrum from the target color, relative to that color's largest component.
  struct Residual {
    std::array<double, 3> value{};
    std::array<std::array<double, 3>, 3> derivative{};  // [channel][coefficient].
    double squared = 0;
  };
  Residual Evaluate(Rgb rgb, const Coefficients& c) const;

  std::vector<Node> nodes_;
};

// Coefficients of a constant spectrum: c1 = c2 = 0. Clamps value to [0, 1].
SigmoidFitter::Coefficients FitGray(double value);

// Fits the spectrum of a reflectance to rgb directly (some tens of microseconds). Components are
// clamped to [0, 1]. Colors that no such spectrum reaches (near the gamut's boundary) are
// approximated.
SigmoidSpectrum FitSigmoid(Rgb rgb);
// The same for a color outside the sRGB gamut that spectra can reach: components may be negative or
// above 1.
SigmoidSpectrum FitSigmoidOutOfGamut(Rgb rgb);

}  // namespace sheaf::render
