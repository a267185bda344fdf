// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The measured spectra that scenes name, and phases of daylight.
#pragma once

#include <string>
#include <vector>

#include "common/scene/spectrum/spectrum_data.h"

namespace sheaf {

// Corrects the temperatures of the daylight names. The constant of Planck's law has changed since
// D65 was named, which moved its temperature from 6500 K.
inline constexpr double kPlanckConstantRatio = 1.4388 / 1.438;
inline constexpr double kD65TemperatureK = 6500 * kPlanckConstantRatio;

// CIE daylight of a correlated color temperature from 4000 to 25000 K. Source: CIE 15:2004, 3.2.
double Daylight(double temperature_k, double nm);

// Which member is set tells the kind.
struct NamedSpectrum {
  std::string name;
  double daylight_k = 0;
  const double* metal = nullptr;
  const double* lamp = nullptr;
  const spectrum_data::Table* table = nullptr;

  double At(double nm) const;
};

const std::vector<NamedSpectrum>& AllNamedSpectra();
// Returns null for other names. Integrals ask for each nanometer.
const NamedSpectrum* FindNamed(const std::string& name);

}  // namespace sheaf
