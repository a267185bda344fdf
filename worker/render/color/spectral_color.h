// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Colours as spectra. What a scene gives as RGB becomes the smooth spectrum that looks like it
// (sigmoid_spectrum.h); a grey is the same at every wavelength, exactly. What a scene gives as a
// spectrum is used as it is.
//
// Units agree with common/scene/spectrum/spectrum.h: emission has luminance 1 where a spectrum or a
// temperature gives it, and that of its RGB otherwise, when integrated by RgbOf. As in pbrt-v4, RGB
// emission is the spectrum of a reflectance, scaled, times D65.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"
#include "worker/render/color/sigmoid_spectrum.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

// One colour of the scene, ready to be evaluated. A few dozen bytes; measured spectra are shared.
// Thread safety: any number of threads at once.
class SpectralColor {
 public:
  SpectralColor() = default;  // Black.
  // kReflectance: within [0, 1]. kIlluminant: spectral radiance per nm that RgbOf integrates.
  // kUnbounded: the values of a spectrum as they are, RGB without an illuminant.
  // Requires: a named spectrum exists.
  static SpectralColor Make(const ColorSpec& color, ColorRole role);
  // value(nm), tabulated in steps of 1 nm and linear between.
  static SpectralColor Tabulate(const std::function<double(double nm)>& value);

  Spectral At(const Wavelengths& wavelengths) const;
  // At one wavelength; the ends hold outside of the range.
  float At(float nm) const;

 private:
  SigmoidSpectrum sigmoid_;
  float scale_ = 0;                                  // Of the sigmoid; 0 is black.
  bool is_under_d65_ = false;                        // The sigmoid times the illuminant.
  std::shared_ptr<const std::vector<float>> table_;  // Instead of the sigmoid where there is one.
};

// Spectrum of an RGB value that is known only when rendering (texels, environment maps), by
// interpolating a table of fits (upsampling_table.h): within 0.6 % of what Make gives for the same
// colour, as RGB and relative to its largest component. Negative components count as 0;
// reflectances are clamped to 1. What is not finite stays so, for a texel that could not be read
// must be noticed. Thread safety: yes.
Spectral Upsample(Rgb rgb, ColorRole role, const Wavelengths& wavelengths);
// Makes the table, which takes about half a second, unless it is there. Upsample would do so too,
// in the middle of a picture. Thread safety: yes.
void PrepareUpsampling();

// An RGB value as what a path carries.
template <typename Color>
Color ColorOfRgb(Rgb rgb, ColorRole role, const WavelengthsOf<Color>& wavelengths) {
  if constexpr (std::is_same_v<Color, Spectral>) {
    return Upsample(rgb, role, wavelengths);
  } else {
    return rgb;
  }
}

// Linear sRGB that spectral radiance of 1 adds at each whole nanometre from kWavelengthMinNm on,
// linear in between; the last value stands twice, and the fourth component is 0.
using ObserverTable =
    std::array<std::array<float, 4>, static_cast<size_t>(kWavelengthMaxNm - kWavelengthMinNm) + 2>;
ObserverTable MakeObserver(const std::function<std::array<double, 3>(double nm)>& rgb);
const ObserverTable& StandardObserver();  // CIE 1931.

// Linear sRGB of spectral radiance: one path's estimate. To the standard observer radiance that is
// 1 times D65 (kIlluminant of RGB white) has expectation (1, 1, 1).
Rgb RgbOf(const Spectral& radiance, const Wavelengths& wavelengths,
          const ObserverTable& observer = StandardObserver());

}  // namespace sheaf::render
