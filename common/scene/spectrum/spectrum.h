// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// From spectra to the linear sRGB that RGB transport uses, so that the picture agrees with what a
// spectral renderer shows for the same scene wherever three channels can: reflectances are seen
// under D65, the white of sRGB; emission is normalised to luminance 1 as pbrt-v4 does; a
// conductor's three channels reflect at normal incidence exactly what its spectrum would. Source:
// CIE 15:2004 (colour matching functions, illuminants), IEC 61966-2-1 (sRGB primaries).
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

// Value of the spectrum at a wavelength; 0 outside of what is tabulated. A blackbody is its
// spectral radiance in W sr^-1 m^-3. Requires: spectrum.kind is not kRgb; a named one exists.
double EvaluateSpectrum(const ColorSpec& spectrum, double wavelength_nm);

// Integrals over wavelength are sums over every whole nanometre of this range, pbrt-v4's.
inline constexpr int kSpectrumFirstNm = 360, kSpectrumLastNm = 830;
inline constexpr size_t kSpectrumCount = kSpectrumLastNm - kSpectrumFirstNm + 1;

// Linear sRGB, negative components included, that spectral radiance of 1 adds at a wavelength: the
// CIE 1931 observer seen through the sRGB primaries. Held at the range's ends outside of it.
std::array<double, 3> ObserverRgb(double wavelength_nm);
// Linear sRGB of CIE XYZ, negative components included; XYZ of D65 with Y = 1 is (1, 1, 1).
std::array<double, 3> SrgbFromXyz(const std::array<double, 3>& xyz);
// The CIE 1931 observer's luminous efficiency. Held at the range's ends outside of it.
double LuminousEfficiency(double wavelength_nm);
// A light as warm as the temperature says, of any magnitude: a phase of daylight from 4000 K on,
// below that a blackbody, as pbrt-v4 balances by. The temperature is in the scale in which D65 has
// 6500 K. Source: CIE 15:2004, 3.2.
double LightOfTemperature(double temperature_k, double wavelength_nm);
// Spectral radiance of D65 scaled to luminance 1, so that it integrates to linear sRGB (1, 1, 1).
double UnitD65(double wavelength_nm);
// Luminance of the spectrum as written, which its use as an illuminant divides by.
// Requires: as EvaluateSpectrum.
double SpectrumLuminance(const ColorSpec& spectrum);

// Linear sRGB of a colour in its role. kRgb colours are returned as they are. Reflectances and
// illuminants outside of the sRGB gamut are clamped to it (reflectances to [0, 1], illuminants to
// >= 0): negative components would make negative light.
// Illuminants have luminance 1 before clamping, whatever their magnitude, as in pbrt-v4.
Rgb SpectrumToRgb(const ColorSpec& spectrum, ColorRole role);

// Whether linear sRGB can show the colour. Narrow bands, such as a sodium lamp's, and saturated RGB
// of wider primaries it cannot.
bool IsWithinSrgb(const ColorSpec& spectrum, ColorRole role);

// Index of refraction of an uncoloured dielectric: the mean over wavelengths weighted by D65 and
// luminous efficiency. RGB transport has no dispersion.
float MeanIndex(const ColorSpec& eta);

// Whether the spectrum has more than one value between 360 and 830 nm.
bool VariesWithWavelength(const ColorSpec& spectrum);
// An index of refraction at a wavelength: as EvaluateSpectrum, but the ends of a table hold beyond
// them.
double IndexAt(const ColorSpec& eta, double wavelength_nm);

// Index of refraction and absorption of a conductor, per channel.
struct ConductorConstants {
  Rgb eta, k;
};
// eta and k per channel such that reflectance at normal incidence, for light in matter of index
// `outside`, equals the spectral one integrated to RGB. Both are against vacuum, given and
// returned. RGB colours pass through.
ConductorConstants ConductorRgb(const ColorSpec& eta, const ColorSpec& k, float outside = 1);
// pbrt-v4's rule: eta = 1 and k = 2 sqrt(r) / sqrt(1 - r), exact at normal incidence.
ConductorConstants ConductorFromReflectance(Rgb reflectance);
// Reflectance at normal incidence of a conductor against vacuum.
double ConductorNormalReflectance(double eta, double k);

}  // namespace sheaf
