// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SpectralColor: colors as spectra. RGB from a scene becomes a smooth spectrum of that color
// (sigmoid_spectrum.h); a gray is exactly constant over wavelength. Spectra from a scene are used
// unchanged.
//
// Units agree with common/scene/spectrum/spectrum.h: integrated by RgbOf, emission has luminance 1
// if given by a spectrum or a temperature, and otherwise that of its RGB. As in pbrt-v4, RGB
// emission is the spectrum of a reflectance, scaled, times D65.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"
#include "common/scene/spectrum/narrow_bands.h"
#include "worker/render/color/sigmoid_spectrum.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

// A color of the scene, ready for evaluation. A few dozen bytes; measured spectra are shared.
// Thread safety: any number of threads at once.
class SpectralColor {
 public:
  SpectralColor() = default;  // Black.
  // kReflectance: within [0, 1]. kIlluminant: spectral radiance per nm that RgbOf integrates.
  // kUnbounded: spectra unchanged, RGB without an illuminant. Requires: a named spectrum exists.
  static SpectralColor Make(const ColorSpec& color, ColorRole role);
  // Tabulates value(nm) in steps of 1 nm, with linear interpolation.
  static SpectralColor Tabulate(const std::function<double(double nm)>& value);

  Spectral At(const Wavelengths& wavelengths) const;
  // At one wavelength; constant outside the range.
  float At(float nm) const;

 private:
  // Tabulates scale(value) of the color's values; exact within its narrow bands.
  static SpectralColor TabulateMeasured(const ColorSpec& color,
                                        const std::function<double(double value)>& scale);
  void SetBands(const Wavelengths& wavelengths, Spectral* values) const;

  SigmoidSpectrum sigmoid_;
  float scale_ = 0;                                  // Factor of the sigmoid; 0 is black.
  bool is_under_d65_ = false;                        // The sigmoid is multiplied by the illuminant.
  std::shared_ptr<const std::vector<float>> table_;  // If set, replaces the sigmoid.
  // If set, replaces the table within the bands.
  std::shared_ptr<const std::vector<NarrowBand>> bands_;
};

// Spectrum of an RGB value that is known only during rendering (texels, environment maps), by
// interpolation in a table of fits (upsampling_table.h): within 0.6 % of the result of Make for the
// same color, as RGB relative to its largest component. Negative components count as 0;
// reflectances are clamped to 1. Non-finite values stay non-finite, so that unreadable texels are
// noticed. Thread safety: any number of threads at once.
Spectral Upsample(Rgb rgb, ColorRole role, const Wavelengths& wavelengths);
// Builds the table, which takes about half a second, unless it exists. Otherwise Upsample would
// build it during rendering. Thread safety: any number of threads at once.
void PrepareUpsampling();

// An RGB value in the color type of a path.
template <typename Color>
Color ColorOfRgb(Rgb rgb, ColorRole role, const WavelengthsOf<Color>& wavelengths) {
  if constexpr (std::is_same_v<Color, Spectral>) {
    return Upsample(rgb, role, wavelengths);
  } else {
    return rgb;
  }
}

// Linear sRGB contribution of spectral radiance 1 at each whole nanometer from kWavelengthMinNm on,
// linear in between; the last value is repeated, and the fourth component is 0.
using ObserverTable =
    std::array<std::array<float, 4>, static_cast<size_t>(kWavelengthMaxNm - kWavelengthMinNm) + 2>;
ObserverTable MakeObserver(const std::function<std::array<double, 3>(double nm)>& rgb);
const ObserverTable& StandardObserver();  // CIE 1931.

// Linear sRGB of spectral radiance: one path's estimate. For the standard observer, radiance equal
// to D65 (kIlluminant of RGB white) has expectation (1, 1, 1).
Rgb RgbOf(const Spectral& radiance, const Wavelengths& wavelengths,
          const ObserverTable& observer = StandardObserver());

}  // namespace sheaf::render
