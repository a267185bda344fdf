// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/named_spectra.h"

#include <algorithm>
#include <unordered_map>

#include "common/math/elementary.h"
#include "common/scene/spectrum/table_lookup.h"

namespace sheaf {
namespace {

namespace data = spectrum_data;

constexpr double kElectronVoltNm =
    1239.84;  // Wavelength in nm of a photon of 1 eV, as in the tables.

// CIE illuminant A. Source: CIE 15:2004, eq. 3.1 (Planck's law at 2848 K with the old constant).
double IlluminantA(double nm) {
  const double ratio = 560 / nm;
  const double fifth = ratio * ratio * ratio * ratio * ratio;
  return 100 * fifth * Expm1(1.435e7 / (2848 * 560)) / Expm1(1.435e7 / (2848 * nm));
}

double MetalAt(const double* values, double nm) {
  return Equidistant(values, data::kMetalCount, data::kMetalFirstEv, data::kMetalStepEv,
                     kElectronVoltNm / nm);
}

// 0 beyond the table's ends.
double FluorescentAt(const double* values, double nm) {
  constexpr double kEndNm =
      data::kFluorescentFirstNm + data::kFluorescentStepNm * (data::kFluorescentCount - 1);
  if (nm < data::kFluorescentFirstNm || nm > kEndNm) return 0;
  return Equidistant(values, data::kFluorescentCount, data::kFluorescentFirstNm,
                     data::kFluorescentStepNm, nm);
}

double TableAt(const data::Table& table, double nm) {
  return PiecewiseLinear(
      table.wavelengths_nm, table.values, table.count,
      std::clamp(nm, table.wavelengths_nm[0], table.wavelengths_nm[table.count - 1]));
}

std::vector<NamedSpectrum> MakeNamedSpectra() {
  std::vector<NamedSpectrum> named = {
      {.name = "stdillum-A"},
      {.name = "stdillum-D50", .daylight_k = 5000 * kPlanckConstantRatio},
      {.name = "stdillum-D65", .daylight_k = kD65TemperatureK},
      {.name = "illum-acesD60", .daylight_k = 6000 * kPlanckConstantRatio}};
  for (size_t i = 0; i < data::kFluorescentLampCount; ++i) {
    named.push_back({.name = "stdillum-F" + std::to_string(i + 1), .lamp = data::kFluorescent[i]});
  }
  for (const data::Metal& metal : data::kMetals) {
    const std::string prefix = std::string("metal-") + metal.name;
    named.push_back({.name = prefix + "-eta", .metal = metal.eta});
    named.push_back({.name = prefix + "-k", .metal = metal.k});
  }
  for (const data::Table& table : data::kTables) {
    named.push_back({.name = table.name, .table = &table});
  }
  return named;
}

}  // namespace

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

double NamedSpectrum::At(double nm) const {
  if (daylight_k > 0) return Daylight(daylight_k, nm);
  if (metal != nullptr) return MetalAt(metal, nm);
  if (lamp != nullptr) return FluorescentAt(lamp, nm);
  return table != nullptr ? TableAt(*table, nm) : IlluminantA(nm);
}

const std::vector<NamedSpectrum>& AllNamedSpectra() {
  static const std::vector<NamedSpectrum> named = MakeNamedSpectra();
  return named;
}

const NamedSpectrum* FindNamed(const std::string& name) {
  static const auto by_name = [] {
    std::unordered_map<std::string, const NamedSpectrum*> result;
    for (const NamedSpectrum& named : AllNamedSpectra()) result.emplace(named.name, &named);
    return result;
  }();
  const auto found = by_name.find(name);
  return found == by_name.end() ? nullptr : found->second;
}

}  // namespace sheaf
