// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/spectrum.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "common/base/check.h"
#include "common/math/elementary.h"
#include "common/scene/spectrum/narrow_bands.h"
#include "common/scene/spectrum/spectrum_data.h"

namespace sheaf {
namespace {

namespace data = spectrum_data;

constexpr int kFirstNm = kSpectrumFirstNm, kLastNm = kSpectrumLastNm;
constexpr double kElectronVoltNm =
    1239.84;  // Wavelength in nm of a photon of 1 eV, as in the tables.

// Linear interpolation in an equidistant table; constant beyond its ends.
double Equidistant(const double* values, size_t count, double first, double step, double at) {
  const double position = std::clamp((at - first) / step, 0.0, static_cast<double>(count - 1));
  const size_t below = std::min(static_cast<size_t>(position), count - 2);
  const double t = position - static_cast<double>(below);
  return values[below] * (1 - t) + values[below + 1] * t;
}

// Linear interpolation in a table of any spacing; 0 outside.
template <typename T>
double PiecewiseLinear(const T* wavelengths_nm, const T* values, size_t count, double at) {
  if (count == 0 || at < wavelengths_nm[0] || at > wavelengths_nm[count - 1]) return 0;
  const T* above = std::upper_bound(wavelengths_nm, wavelengths_nm + count, at);
  const auto i = static_cast<size_t>(above - wavelengths_nm);
  if (i == count) return values[count - 1];
  const double low = wavelengths_nm[i - 1];
  const double t = (at - low) / (wavelengths_nm[i] - low);
  return values[i - 1] * (1 - t) + values[i] * t;
}

// CIE illuminant A. Source: CIE 15:2004, eq. 3.1 (Planck's law at 2848 K with the old constant).
double IlluminantA(double nm) {
  const double ratio = 560 / nm;
  const double fifth = ratio * ratio * ratio * ratio * ratio;
  return 100 * fifth * Expm1(1.435e7 / (2848 * 560)) / Expm1(1.435e7 / (2848 * nm));
}

// CIE daylight of a correlated color temperature from 4000 to 25000 K. Source: CIE 15:2004, 3.2.
double Daylight(double temperature_k, double nm) {
  const double r = 1000 / temperature_k;
  const double x = temperature_k <= 7000 ? ((-4.6070 * r + 2.9678) * r + 0.09911) * r + 0.244063
                                         : ((-2.0064 * r + 1.9018) * r + 0.24748) * r + 0.237040;
  const double y = -3 * x * x + 2.87 * x - 0.275;
  const double m = 0.0241 + 0.2562 * x - 0.7341 * y;
  const double m1 = (-1.3515 - 1.7703 * x + 5.9114 * y) / m;
  const double m2 = (0.03 - 31.4424 * x + 30.0717 * y) / m;
  const auto component = [&](const double* values) {
    return Equidistant(values, data::kDaylightCount, data::kDaylightFirstNm, data::kDaylightStepNm,
                       nm);
  };
  return component(data::kDaylightS0) + m1 * component(data::kDaylightS1) +
         m2 * component(data::kDaylightS2);
}

// Corrects the temperatures of the daylight names. The constant of Planck's law has changed since
// D65 was named, which moved its temperature from 6500 K.
constexpr double kConstantRatio = 1.4388 / 1.438;
std::optional<double> DaylightTemperature(const std::string& name) {
  if (name == "stdillum-D50") return 5000 * kConstantRatio;
  if (name == "stdillum-D65") return 6500 * kConstantRatio;
  if (name == "illum-acesD60") return 6000 * kConstantRatio;
  return std::nullopt;
}

// Planck's law. Source: CODATA 2010, the values pbrt-v4 uses.
double Blackbody(double temperature_k, double nm) {
  constexpr double kLightSpeed = 299792458, kPlanck = 6.62606957e-34, kBoltzmann = 1.3806488e-23;
  const double metres = nm * 1e-9;
  const double fifth = metres * metres * metres * metres * metres;
  return 2 * kPlanck * kLightSpeed * kLightSpeed /
         (fifth * Expm1(kPlanck * kLightSpeed / (metres * kBoltzmann * temperature_k)));
}

// "metal-Cu-eta" and the like; empty for other names.
std::optional<double> MetalAt(const std::string& name, double nm) {
  for (const data::Metal& metal : data::kMetals) {
    const std::string prefix = std::string("metal-") + metal.name;
    const bool is_eta = name == prefix + "-eta";
    if (!is_eta && name != prefix + "-k") continue;
    return Equidistant(is_eta ? metal.eta : metal.k, data::kMetalCount, data::kMetalFirstEv,
                       data::kMetalStepEv, kElectronVoltNm / nm);
  }
  return std::nullopt;
}

std::string FluorescentName(size_t lamp) { return "stdillum-F" + std::to_string(lamp + 1); }

// "stdillum-F1" and the like; empty for other names. 0 beyond the table's ends.
std::optional<double> FluorescentAt(const std::string& name, double nm) {
  if (!name.starts_with("stdillum-F")) return std::nullopt;
  for (size_t i = 0; i < data::kFluorescentLampCount; ++i) {
    if (name != FluorescentName(i)) continue;
    constexpr double kEndNm =
        data::kFluorescentFirstNm + data::kFluorescentStepNm * (data::kFluorescentCount - 1);
    if (nm < data::kFluorescentFirstNm || nm > kEndNm) return 0;
    return Equidistant(data::kFluorescent[i], data::kFluorescentCount, data::kFluorescentFirstNm,
                       data::kFluorescentStepNm, nm);
  }
  return std::nullopt;
}

std::optional<double> NamedAt(const std::string& name, double nm) {
  if (name == "stdillum-A") return IlluminantA(nm);
  if (const auto lamp = FluorescentAt(name, nm)) return lamp;
  if (const auto temperature = DaylightTemperature(name)) return Daylight(*temperature, nm);
  if (const auto metal = MetalAt(name, nm)) return metal;
  for (const data::Table& table : data::kTables) {
    if (name != table.name) continue;
    return PiecewiseLinear(
        table.wavelengths_nm, table.values, table.count,
        std::clamp(nm, table.wavelengths_nm[0], table.wavelengths_nm[table.count - 1]));
  }
  return std::nullopt;
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

template <typename Function>
Xyz Integrate(const Function& radiance) {
  Xyz sum;
  for (int nm = kFirstNm; nm <= kLastNm; ++nm) {
    const double value = radiance(nm);
    sum.x += CmfAt(data::kCmfX, nm) * value;
    sum.y += CmfAt(data::kCmfY, nm) * value;
    sum.z += CmfAt(data::kCmfZ, nm) * value;
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
  const double temperature_k = *DaylightTemperature("stdillum-D65");
  const Xyz white = Integrate([&](int nm) { return Daylight(temperature_k, nm); });
  for (size_t i = 0; i < kSpectrumCount; ++i) {
    space.d65[i] = Daylight(temperature_k, kFirstNm + static_cast<double>(i)) / white.y;
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

// Mean of a spectrum for each channel, weighted by how strongly each wavelength under D65 makes the
// channel brighter. Negative lobes, which a mean cannot have, have weight 0.
Rgb ChannelMeans(const ColorSpec& spectrum) {
  Rgb means;
  for (size_t i = 0; i < 3; ++i) {
    double sum = 0, weights = 0;
    for (int nm = kFirstNm; nm <= kLastNm; ++nm) {
      const double weight =
          std::max(0.0, ObserverRgb(nm)[i]) * Space().d65[static_cast<size_t>(nm - kFirstNm)];
      sum += weight * EvaluateSpectrum(spectrum, nm);
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

bool IsNamedSpectrum(const std::string& name) { return NamedAt(name, 550).has_value(); }

std::vector<std::string> NamedSpectra() {
  std::vector<std::string> names = {"stdillum-A", "stdillum-D50", "stdillum-D65", "illum-acesD60"};
  for (size_t i = 0; i < data::kFluorescentLampCount; ++i) names.push_back(FluorescentName(i));
  for (const data::Metal& metal : data::kMetals) {
    names.push_back(std::string("metal-") + metal.name + "-eta");
    names.push_back(std::string("metal-") + metal.name + "-k");
  }
  for (const data::Table& table : data::kTables) names.emplace_back(table.name);
  return names;
}

double EvaluateSpectrum(const ColorSpec& spectrum, double wavelength_nm) {
  switch (spectrum.kind) {
    case ColorSpec::Kind::kSampled:
      return PiecewiseLinear(spectrum.wavelengths_nm.data(), spectrum.values.data(),
                             spectrum.values.size(), wavelength_nm);
    case ColorSpec::Kind::kNamed: {
      const std::optional<double> value = NamedAt(spectrum.name, wavelength_nm);
      SHEAF_CHECK(value.has_value());
      return *value;
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
  const double cct_k = temperature_k * kConstantRatio;
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
