// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/spectrum.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/base/check.h"
#include "common/math/elementary.h"
#include "common/scene/spectrum/named_spectra.h"
#include "common/scene/spectrum/narrow_bands.h"
#include "common/scene/spectrum/spectrum_data.h"
#include "common/scene/spectrum/table_lookup.h"

namespace sheaf {
namespace {

namespace data = spectrum_data;

constexpr int kFirstNm = kSpectrumFirstNm, kLastNm = kSpectrumLastNm;

// Planck's law. Source: CODATA 2010, the values pbrt-v4 uses.
double Blackbody(double temperature_k, double nm) {
  constexpr double kLightSpeed = 299792458, kPlanck = 6.62606957e-34, kBoltzmann = 1.3806488e-23;
  const double metres = nm * 1e-9;
  const double fifth = metres * metres * metres * metres * metres;
  return 2 * kPlanck * kLightSpeed * kLightSpeed /
         (fifth * Expm1(kPlanck * kLightSpeed / (metres * kBoltzmann * temperature_k)));
}

struct Xyz {
  double x = 0, y = 0, z = 0;
};

double CmfAt(const double* values, double nm) {
  return Equidistant(values, data::kCmfCount, data::kCmfFirstNm, data::kCmfStepNm, nm);
}

// Adds to *sum what a sum over whole nanometers misses of the spectrum's narrow bands times a
// factor that is linear between them. Simpson's rule is exact for the product.
template <typename Function, typename Sum>
void AddNarrowBands(const ColorSpec& spectrum, const Function& factor, const Sum& add) {
  for (const NarrowBand& band : NarrowBandsOf(spectrum)) {
    const double first = band.first - band.table_first, last = band.last - band.table_last;
    const double width = (band.last_nm - band.first_nm) / 6;
    const double middle_nm = 0.5 * (band.first_nm + band.last_nm);
    add(band.first_nm, width * first * factor(band.first_nm));
    add(middle_nm, 4 * width * 0.5 * (first + last) * factor(middle_nm));
    add(band.last_nm, width * last * factor(band.last_nm));
  }
}

// The observer at each whole nanometer.
const std::array<Xyz, kSpectrumCount>& Observer() {
  static const auto observer = [] {
    std::array<Xyz, kSpectrumCount> result;
    for (size_t i = 0; i < kSpectrumCount; ++i) {
      const double nm = kFirstNm + static_cast<double>(i);
      result[i] = {CmfAt(data::kCmfX, nm), CmfAt(data::kCmfY, nm), CmfAt(data::kCmfZ, nm)};
    }
    return result;
  }();
  return observer;
}

template <typename Function>
Xyz Integrate(const Function& radiance) {
  const auto& observer = Observer();
  Xyz sum;
  for (int nm = kFirstNm; nm <= kLastNm; ++nm) {
    const double value = radiance(nm);
    const Xyz& response = observer[static_cast<size_t>(nm - kFirstNm)];
    sum.x += response.x * value;
    sum.y += response.y * value;
    sum.z += response.z * value;
  }
  return sum;
}

// Linear sRGB whose white is exactly that of the D65 table here, so that gray stays gray.
struct ColorSpace {
  std::array<double, kSpectrumCount> d65;  // Normalized to luminance 1.
  std::array<std::array<double, 3>, 3> rgb_from_xyz;
};

// Columns of xyz_from_rgb are the primaries scaled such that rgb (1, 1, 1) is white.
ColorSpace MakeColorSpace() {
  ColorSpace space;
  const Xyz white = Integrate([](int nm) { return Daylight(kD65TemperatureK, nm); });
  for (size_t i = 0; i < kSpectrumCount; ++i) {
    space.d65[i] = Daylight(kD65TemperatureK, kFirstNm + static_cast<double>(i)) / white.y;
  }
  // Chromaticities of the sRGB primaries. Source: IEC 61966-2-1.
  constexpr double kPrimaries[3][2] = {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}};
  Matrix4 xyz_from_rgb;
  for (size_t i = 0; i < 3; ++i) {
    const double x = kPrimaries[i][0], y = kPrimaries[i][1];
    xyz_from_rgb.m[0][i] = x / y;
    xyz_from_rgb.m[1][i] = 1;
    xyz_from_rgb.m[2][i] = (1 - x - y) / y;
  }
  Matrix4 inverse;
  SHEAF_CHECK(Invert(xyz_from_rgb, &inverse));
  const Vec3d scale = TransformVector(inverse, {white.x / white.y, 1, white.z / white.y});
  for (size_t row = 0; row < 3; ++row) {
    for (size_t i = 0; i < 3; ++i) space.rgb_from_xyz[row][i] = inverse.m[row][i] / scale[row];
  }
  return space;
}

const ColorSpace& Space() {
  static const ColorSpace space = MakeColorSpace();
  return space;
}

Rgb ToRgb(const Xyz& xyz) {
  Rgb rgb;
  for (size_t i = 0; i < 3; ++i) {
    const auto& row = Space().rgb_from_xyz[i];
    rgb[i] = static_cast<float>(row[0] * xyz.x + row[1] * xyz.y + row[2] * xyz.z);
  }
  return rgb;
}

// The same for the spectrum times a factor that is linear between whole nanometers.
template <typename Function>
Xyz IntegrateTimes(const ColorSpec& spectrum, const Function& factor) {
  Xyz sum = Integrate([&](int nm) { return factor(nm) * EvaluateSpectrum(spectrum, nm); });
  AddNarrowBands(spectrum, factor, [&](double nm, double value) {
    sum.x += CmfAt(data::kCmfX, nm) * value;
    sum.y += CmfAt(data::kCmfY, nm) * value;
    sum.z += CmfAt(data::kCmfZ, nm) * value;
  });
  return sum;
}

// The color of a surface of this spectrum under D65.
template <typename Function>
Rgb UnderD65(const Function& spectrum) {
  const auto& d65 = Space().d65;
  return ToRgb(
      Integrate([&](int nm) { return d65[static_cast<size_t>(nm - kFirstNm)] * spectrum(nm); }));
}

Rgb Clamp(Rgb rgb, float maximum) {
  for (size_t i = 0; i < 3; ++i) rgb[i] = std::clamp(rgb[i], 0.f, maximum);
  return rgb;
}

Xyz IlluminantXyz(const ColorSpec& spectrum) {
  return IntegrateTimes(spectrum, [](double) { return 1.0; });
}

// Has luminance 1; negative components if the color lies outside of sRGB.
Rgb IlluminantRgb(const ColorSpec& spectrum) {
  const Xyz xyz = IlluminantXyz(spectrum);
  if (!(xyz.y > 0)) return Rgb{};
  return ToRgb({xyz.x / xyz.y, 1, xyz.z / xyz.y});
}
Rgb ReflectanceRgb(const ColorSpec& spectrum) { return ToRgb(IntegrateTimes(spectrum, UnitD65)); }

// Weights of the whole nanometers in the mean of each channel.
const std::array<std::array<double, kSpectrumCount>, 3>& ChannelWeights() {
  static const auto weights = [] {
    std::array<std::array<double, kSpectrumCount>, 3> result;
    for (size_t n = 0; n < kSpectrumCount; ++n) {
      const std::array<double, 3> rgb = ObserverRgb(kFirstNm + static_cast<double>(n));
      for (size_t i = 0; i < 3; ++i) result[i][n] = std::max(0.0, rgb[i]) * Space().d65[n];
    }
    return result;
  }();
  return weights;
}

// Mean of a spectrum for each channel, weighted by how strongly each wavelength under D65 makes the
// channel brighter. Negative lobes, which a mean cannot have, have weight 0.
Rgb ChannelMeans(const ColorSpec& spectrum) {
  std::array<double, kSpectrumCount> values;
  for (size_t n = 0; n < kSpectrumCount; ++n) {
    values[n] = EvaluateSpectrum(spectrum, kFirstNm + static_cast<double>(n));
  }
  Rgb means;
  for (size_t i = 0; i < 3; ++i) {
    double sum = 0, weights = 0;
    for (size_t n = 0; n < kSpectrumCount; ++n) {
      const double weight = ChannelWeights()[i][n];
      sum += weight * values[n];
      weights += weight;
    }
    AddNarrowBands(
        spectrum, [i](double nm) { return std::max(0.0, ObserverRgb(nm)[i]) * UnitD65(nm); },
        [&sum](double, double value) { sum += value; });
    means[i] = static_cast<float>(sum / weights);
  }
  return means;
}

// Reflectance at normal incidence in each channel. If one of the two is RGB, each channel uses its
// own component of it.
Rgb ConductorReflectance(const ColorSpec& eta, const ColorSpec& k, double outside) {
  const auto value = [](const ColorSpec& color, size_t channel, int nm) -> double {
    return color.kind == ColorSpec::Kind::kRgb ? color.rgb[channel] : EvaluateSpectrum(color, nm);
  };
  Rgb reflectance;
  for (size_t i = 0; i < 3; ++i) {
    reflectance[i] = UnderD65([&](int nm) {
      return ConductorNormalReflectance(value(eta, i, nm) / outside, value(k, i, nm) / outside);
    })[i];
  }
  return reflectance;
}

}  // namespace

bool IsNamedSpectrum(const std::string& name) { return FindNamed(name) != nullptr; }

std::vector<std::string> NamedSpectra() {
  std::vector<std::string> names;
  for (const NamedSpectrum& named : AllNamedSpectra()) names.push_back(named.name);
  return names;
}

double EvaluateSpectrum(const ColorSpec& spectrum, double wavelength_nm) {
  switch (spectrum.kind) {
    case ColorSpec::Kind::kSampled:
      return PiecewiseLinear(spectrum.wavelengths_nm.data(), spectrum.values.data(),
                             spectrum.values.size(), wavelength_nm);
    case ColorSpec::Kind::kNamed: {
      const NamedSpectrum* named = FindNamed(spectrum.name);
      SHEAF_CHECK(named != nullptr);
      return named->At(wavelength_nm);
    }
    case ColorSpec::Kind::kBlackbody:
      return Blackbody(spectrum.temperature_k, wavelength_nm);
    case ColorSpec::Kind::kRgb:
      break;
  }
  SHEAF_CHECK(false);
  return 0;
}

std::array<double, 3> ObserverRgb(double wavelength_nm) {
  std::array<double, 3> rgb{};
  for (size_t i = 0; i < 3; ++i) {
    const auto& row = Space().rgb_from_xyz[i];
    rgb[i] = row[0] * CmfAt(data::kCmfX, wavelength_nm) +
             row[1] * CmfAt(data::kCmfY, wavelength_nm) +
             row[2] * CmfAt(data::kCmfZ, wavelength_nm);
  }
  return rgb;
}

std::array<double, 3> SrgbFromXyz(const std::array<double, 3>& xyz) {
  std::array<double, 3> rgb{};
  for (size_t i = 0; i < 3; ++i) {
    const auto& row = Space().rgb_from_xyz[i];
    rgb[i] = row[0] * xyz[0] + row[1] * xyz[1] + row[2] * xyz[2];
  }
  return rgb;
}

double LuminousEfficiency(double wavelength_nm) { return CmfAt(data::kCmfY, wavelength_nm); }

double LightOfTemperature(double temperature_k, double wavelength_nm) {
  const double cct_k = temperature_k * kPlanckConstantRatio;
  return cct_k >= 4000 ? Daylight(cct_k, wavelength_nm) : Blackbody(cct_k, wavelength_nm);
}

double UnitD65(double wavelength_nm) {
  return Equidistant(Space().d65.data(), kSpectrumCount, kFirstNm, 1, wavelength_nm);
}

double SpectrumLuminance(const ColorSpec& spectrum) { return IlluminantXyz(spectrum).y; }

Rgb SpectrumToRgb(const ColorSpec& spectrum, ColorRole role) {
  if (spectrum.kind == ColorSpec::Kind::kRgb) return spectrum.rgb;
  if (role == ColorRole::kIlluminant) return Clamp(IlluminantRgb(spectrum), INFINITY);
  if (role == ColorRole::kUnbounded) return ChannelMeans(spectrum);
  return Clamp(ReflectanceRgb(spectrum), 1);
}

bool IsWithinSrgb(const ColorSpec& spectrum, ColorRole role) {
  if (role == ColorRole::kUnbounded) return true;
  if (spectrum.kind == ColorSpec::Kind::kRgb) return !spectrum.is_out_of_gamut;
  const bool emits = role == ColorRole::kIlluminant;
  const Rgb rgb = emits ? IlluminantRgb(spectrum) : ReflectanceRgb(spectrum);
  // The tables' own rounding moves a color by this much.
  constexpr float kTolerance = 1e-3f;
  const float largest = std::max(MaxComponent(rgb), 1.0f);
  const bool too_small = std::min({rgb.r, rgb.g, rgb.b}) < -kTolerance * largest;
  return !too_small && (emits || largest <= 1 + kTolerance);
}

float MeanIndex(const ColorSpec& eta) {
  if (eta.kind == ColorSpec::Kind::kRgb) return Luminance(eta.rgb);
  const auto& d65 = Space().d65;
  double sum = 0, weights = 0;
  for (int nm = kFirstNm; nm <= kLastNm; ++nm) {
    const double weight = d65[static_cast<size_t>(nm - kFirstNm)] * CmfAt(data::kCmfY, nm);
    sum += weight * EvaluateSpectrum(eta, nm);
    weights += weight;
  }
  return static_cast<float>(sum / weights);
}

double IndexAt(const ColorSpec& eta, double wavelength_nm) {
  if (eta.kind == ColorSpec::Kind::kRgb) return static_cast<double>(Luminance(eta.rgb));
  if (eta.kind == ColorSpec::Kind::kSampled && !eta.wavelengths_nm.empty()) {
    wavelength_nm = std::clamp(wavelength_nm, static_cast<double>(eta.wavelengths_nm.front()),
                               static_cast<double>(eta.wavelengths_nm.back()));
  }
  return EvaluateSpectrum(eta, wavelength_nm);
}

bool VariesWithWavelength(const ColorSpec& spectrum) {
  const double first = IndexAt(spectrum, kFirstNm);
  for (int nm = kFirstNm; nm <= kLastNm; ++nm) {
    if (IndexAt(spectrum, nm) != first) return true;
  }
  return false;
}

double ConductorNormalReflectance(double eta, double k) {
  return ((eta - 1) * (eta - 1) + k * k) / ((eta + 1) * (eta + 1) + k * k);
}

ConductorConstants ConductorRgb(const ColorSpec& eta, const ColorSpec& k, float outside) {
  const bool both_rgb = eta.kind == ColorSpec::Kind::kRgb && k.kind == ColorSpec::Kind::kRgb;
  if (both_rgb) return {eta.rgb, k.rgb};
  const Rgb eta_means = eta.kind == ColorSpec::Kind::kRgb ? eta.rgb : ChannelMeans(eta);
  const Rgb reflectance = ConductorReflectance(eta, k, outside);
  ConductorConstants constants;
  for (size_t i = 0; i < 3; ++i) {
    // Beyond this, k overflows; no metal reflects so much.
    constexpr double kReflectanceMax = 0.999999;
    const double r = std::clamp(static_cast<double>(reflectance[i]), 0.0, kReflectanceMax);
    double n = eta_means[i] / outside;
    // Solves r = ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2) for k.
    const double k_squared = (r * (n + 1) * (n + 1) - (n - 1) * (n - 1)) / (1 - r);
    if (k_squared < 0) {
      // The mean index alone reflects more than r: drop absorption, and choose the index that
      // reflects r.
      n = (1 + std::sqrt(r)) / (1 - std::sqrt(r));
    }
    constants.eta[i] = static_cast<float>(n * outside);
    constants.k[i] = static_cast<float>(std::sqrt(std::max(0.0, k_squared)) * outside);
  }
  return constants;
}

ConductorConstants ConductorFromReflectance(Rgb reflectance) {
  ConductorConstants constants;
  for (size_t i = 0; i < 3; ++i) {
    // As in pbrt-v4: a reflectance of 1 would need an infinite k.
    const float r = std::clamp(reflectance[i], 0.f, 0.9999f);
    constants.eta[i] = 1;
    constants.k[i] = 2 * std::sqrt(r) / std::sqrt(1 - r);
  }
  return constants;
}

}  // namespace sheaf
