// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/narrow_bands.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/scene/spectrum/spectrum.h"

namespace sheaf {
namespace {

// A table is good enough where it differs by less than this part of the largest value, and for the
// whole spectrum if its differences have less than this part of its integral.
constexpr double kValueShareMax = 0.02, kIntegralShareMax = 0.01;

// The ends of the linear pieces of the spectrum, and all whole nanometers.
std::vector<double> EndsOf(const ColorSpec& spectrum) {
  std::vector<double> ends;
  for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; ++nm) ends.push_back(nm);
  for (const float nm : spectrum.wavelengths_nm) {
    if (nm > kSpectrumFirstNm && nm < kSpectrumLastNm) ends.push_back(static_cast<double>(nm));
  }
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  return ends;
}

bool HasShortPieces(const std::vector<float>& nm) {
  for (size_t i = 1; i < nm.size(); ++i) {
    if (nm[i] - nm[i - 1] < 1) return true;
  }
  return false;
}

// The spectrum's values at the ends of a part of one of its pieces.
void SetValues(const ColorSpec& spectrum, NarrowBand* band) {
  const std::vector<float>& nm = spectrum.wavelengths_nm;
  const double middle = 0.5 * (band->first_nm + band->last_nm);
  const auto above = std::upper_bound(nm.begin(), nm.end(), static_cast<float>(middle));
  if (above == nm.begin() || above == nm.end()) return;
  const auto i = static_cast<size_t>(above - nm.begin());
  const double low = nm[i - 1], high = nm[i];
  const double below = spectrum.values[i - 1], behind = spectrum.values[i];
  const auto at = [&](double x) {
    const double part = (x - low) / (high - low);
    return below * (1 - part) + behind * part;
  };
  band->first = at(band->first_nm);
  band->last = at(band->last_nm);
}

}  // namespace

std::vector<NarrowBand> NarrowBandsOf(const ColorSpec& spectrum) {
  if (spectrum.kind != ColorSpec::Kind::kSampled) return {};
  if (!HasShortPieces(spectrum.wavelengths_nm)) return {};
  double largest = 0, integral = 0, difference = 0;
  for (const float value : spectrum.values) {
    largest = std::max(largest, static_cast<double>(std::fabs(value)));
  }
  std::vector<NarrowBand> bands;
  const std::vector<double> ends = EndsOf(spectrum);
  for (size_t i = 1; i < ends.size(); ++i) {
    NarrowBand band;
    band.first_nm = ends[i - 1];
    band.last_nm = ends[i];
    SetValues(spectrum, &band);
    const double below = std::floor(band.first_nm);
    const double at_below = EvaluateSpectrum(spectrum, below);
    const double at_above = EvaluateSpectrum(spectrum, below + 1);
    band.table_first = at_below + (at_above - at_below) * (band.first_nm - below);
    band.table_last = at_below + (at_above - at_below) * (band.last_nm - below);
    const double off =
        std::max(std::fabs(band.first - band.table_first), std::fabs(band.last - band.table_last));
    integral += std::fabs(band.Integral());
    if (!(off > kValueShareMax * largest)) continue;
    difference += off * (band.last_nm - band.first_nm);
    bands.push_back(band);
  }
  if (!(difference > kIntegralShareMax * integral)) return {};
  return bands;
}

}  // namespace sheaf
