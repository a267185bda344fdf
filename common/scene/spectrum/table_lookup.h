// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Linear interpolation in tables of spectra.
#pragma once

#include <algorithm>
#include <cstddef>

namespace sheaf {

// Linear interpolation in an equidistant table; constant beyond its ends.
inline double Equidistant(const double* values, size_t count, double first, double step,
                          double at) {
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

}  // namespace sheaf
