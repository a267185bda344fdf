// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Conversion of spectra to the linear sRGB that RGB transport uses, so that the image agrees with a
// spectral rendering of the same scene as far as three channels can: reflectances are seen under
// D65, the white of sRGB; emission is normalized to luminance 1 as in pbrt-v4; a conductor's three
// channels reflect at normal incidence exactly as its spectrum would. Source: CIE 15:2004 (color
// matching functions, illuminants), IEC 61966-2-1 (sRGB primaries).
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Names of measured spectra that a scene may use: "metal-Cu-eta", "glass-BK7", "stdillum-D65" ...
bool IsNamedSpectrum(const std::string& name);
std::vector<std::string> NamedSpectra();

// Value of the spectrum at a wavelength; 0 outside of the tabulated range. A blackbody has its
// spectral radiance in W sr^-1 m^-3.
// Requires: spectrum.kind is not kRgb; a named one exists.
double EvaluateSpectrum(const ColorSpec& spectrum, double wavelength_nm);

// Integrals over wavelength are sums over every whole nanometer of this range, which is pbrt-v4's.
inline constexpr int kSpectrumFirstNm = 360, kSpectrumLastNm = 830;
inline constexpr size_t kSpectrumCount = kSpectrumLastNm - kSpectrumFirstNm + 1;

// Linear sRGB, including negative components, added by a spectral radiance of 1 at a wavelength:
// the CIE 1931 observer seen through the sRGB primaries. Constant beyond the range's ends.
std::array<double, 3> ObserverRgb(double wavelength_nm);
// Linear sRGB of CIE XYZ, including negative components; XYZ of D65 with Y = 1 is (1, 1, 1).
std::array<double, 3> SrgbFromXyz(const std::array<double, 3>& xyz);
// The CIE 1931 observer's luminous efficiency. Constant beyond the range's ends.
double LuminousEfficiency(double wavelength_nm);
// Spectrum, up to scale, of a light of the given temperature: a phase of daylight from 4000 K on, a
// blackbody below, as in pbrt-v4's balancing. The temperature is in the scale in which D65 has 6500
// K. Source: CIE 15:2004, 3.2.
double LightOfTemperature(double temperature_k, double wavelength_nm);
// Spectral radiance of D65 scaled to luminance 1, so that it integrates to linear sRGB (1, 1, 1).
double UnitD65(double wavelength_nm);
// Luminance of the spectrum as written; its use as an illuminant divides by it.
// Requires: as EvaluateSpectrum.
double SpectrumLuminance(const ColorSpec& spectrum);

// Linear sRGB of a color in its role. kRgb colors are returned unchanged. Reflectances and
// illuminants outside of the sRGB gamut are clamped to it (reflectances to [0, 1], illuminants to
// >= 0): negative components would make negative light. Illuminants have luminance 1 before
// clamping, whatever their magnitude, as in pbrt-v4.
Rgb SpectrumToRgb(const ColorSpec& spectrum, ColorRole role);

// Whether linear sRGB can represent the color. It cannot represent narrow bands, such as that of a
// sodium lamp, nor saturated RGB of wider primaries.
bool IsWithinSrgb(const ColorSpec& spectrum, ColorRole role);

// Index of refraction of a colorless dielectric: the mean over wavelengths weighted by D65 and
// luminous efficiency. RGB transport has no dispersion.
float MeanIndex(const ColorSpec& eta);

// Whether the spectrum has more than one value between 360 and 830 nm.
bool VariesWithWavelength(const ColorSpec& spectrum);
// An index of refraction at a wavelength: as EvaluateSpectrum, but constant beyond the ends of a
// table.
double IndexAt(const ColorSpec& eta, double wavelength_nm);

// Index of refraction and absorption of a conductor, per channel.
struct ConductorConstants {
  Rgb eta, k;
};
// eta and k per channel such that the reflectance at normal incidence, for light arriving from a
// medium of index `outside`, equals the spectral reflectance integrated to RGB. Both, given and
// returned, are relative to vacuum. RGB colors are returned unchanged.
ConductorConstants ConductorRgb(const ColorSpec& eta, const ColorSpec& k, float outside = 1);
// pbrt-v4's rule: eta = 1 and k = 2 sqrt(r) / sqrt(1 - r), exact at normal incidence.
ConductorConstants ConductorFromReflectance(Rgb reflectance);
// Reflectance at normal incidence of a conductor against vacuum.
double ConductorNormalReflectance(double eta, double k);

}  // namespace sheaf
