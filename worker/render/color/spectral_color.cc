// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/spectral_color.h"

#include <algorithm>
#include <array>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "common/scene/spectrum/spectrum.h"
#include "worker/render/color/upsampling_table.h"

namespace sheaf::render {
namespace {

static_assert(kSpectrumFirstNm == kWavelengthMinNm && kSpectrumLastNm == kWavelengthMaxNm);

// Darker colors are black; divisors stay finite.
constexpr float kLargestMin = 1e-30f;

// Tables have 1 nm steps and repeat the last value, so that each entry has a successor.
constexpr size_t kTableSize = kSpectrumCount + 1;
double TableNm(size_t i) { return kSpectrumFirstNm + static_cast<double>(i); }

// Positions of wavelengths in a table. A branch-free loop that compiles to vector instructions.
// Requires: wavelengths are in the range, as Wavelengths guarantees.
struct TablePositions {
  std::array<int, kWavelengthCount> below;
  std::array<float, kWavelengthCount> part;
};
TablePositions PositionsOf(const Wavelengths& wavelengths) {
  TablePositions at;
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    const float position = wavelengths.nm[i] - kWavelengthMinNm;
    at.below[i] = static_cast<int>(position);
    at.part[i] = position - static_cast<float>(at.below[i]);
  }
  return at;
}
Spectral Interpolate(const float* table, const Wavelengths& wavelengths) {
  const TablePositions at = PositionsOf(wavelengths);
  Spectral below, above;
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    below[i] = table[at.below[i]];
    above[i] = table[at.below[i] + 1];
  }
  Spectral values;
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    values[i] = below[i] * (1 - at.part[i]) + above[i] * at.part[i];
  }
  return values;
}

// D65 and the observer in steps of 1 nm. A local static costs one well-predicted comparison per
// call, as a pointer test would, and does not depend on initialization order.
struct Tables {
  std::array<float, kTableSize> d65;
  ObserverTable observer;
};
static_assert(std::tuple_size_v<ObserverTable> == kTableSize);
Tables MakeTables() {
  Tables tables{};
  for (size_t i = 0; i < kTableSize; ++i) {
    tables.d65[i] = static_cast<float>(UnitD65(TableNm(i)));
  }
  tables.observer = MakeObserver(ObserverRgb);
  return tables;
}
const Tables& SharedTables() {
  static const Tables tables = MakeTables();
  return tables;
}
const UpsamplingTable& SharedUpsampling() {
  static const UpsamplingTable table;
  return table;
}

// Clamps an RGB color to the values valid for its role. NaN fails the comparison.
Rgb Admissible(Rgb rgb, ColorRole role) {
  for (size_t i = 0; i < 3; ++i) {
    rgb[i] = rgb[i] > 0 ? rgb[i] : 0;
    if (role == ColorRole::kReflectance) rgb[i] = std::min(rgb[i], 1.f);
  }
  return rgb;
}
bool IsGray(Rgb rgb) { return rgb.r == rgb.g && rgb.g == rgb.b; }

}  // namespace

SpectralColor SpectralColor::Make(const ColorSpec& color, ColorRole role) {
  if (color.kind == ColorSpec::Kind::kRgb) {
    SpectralColor made;
    made.is_under_d65_ = role == ColorRole::kIlluminant;
    if (color.is_out_of_gamut) {
      const float largest = MaxComponent(color.true_rgb);
      if (!(largest >= kLargestMin)) return made;
      const float level = FitLevel(largest, role);
      made.scale_ = largest / level;
      made.sigmoid_ = FitSigmoidOutOfGamut(color.true_rgb * (level / largest));
      return made;
    }
    const Rgb rgb = Admissible(color.rgb, role);
    const float largest = MaxComponent(rgb);
    if (largest < kLargestMin) return made;
    // Half the value at every wavelength, bit for bit, is a sigmoid with zero coefficients.
    const float level = IsGray(rgb) ? 0.5f : FitLevel(largest, role);
    made.scale_ = largest / level;
    if (!IsGray(rgb)) made.sigmoid_ = FitSigmoid(rgb * (level / largest));
    return made;
  }
  switch (role) {
    case ColorRole::kReflectance:
      return TabulateMeasured(color, [](double value) { return std::clamp(value, 0.0, 1.0); });
    case ColorRole::kIlluminant: {
      const double luminance = SpectrumLuminance(color);
      if (!(luminance > 0)) return SpectralColor();
      return TabulateMeasured(
          color, [luminance](double value) { return std::max(0.0, value) / luminance; });
    }
    case ColorRole::kUnbounded:
      break;
  }
  return TabulateMeasured(color, [](double value) { return value; });
}

SpectralColor SpectralColor::TabulateMeasured(const ColorSpec& color,
                                              const std::function<double(double value)>& scale) {
  SpectralColor made = Tabulate([&](double nm) { return scale(EvaluateSpectrum(color, nm)); });
  std::vector<NarrowBand> bands = NarrowBandsOf(color);
  if (bands.empty()) return made;
  for (NarrowBand& band : bands) {
    band.first = scale(band.first);
    band.last = scale(band.last);
  }
  made.bands_ = std::make_shared<const std::vector<NarrowBand>>(std::move(bands));
  return made;
}

void SpectralColor::SetBands(const Wavelengths& wavelengths, Spectral* values) const {
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    const auto nm = static_cast<double>(wavelengths.nm[i]);
    const auto band = std::lower_bound(bands_->begin(), bands_->end(), nm,
                                       [](const NarrowBand& b, double x) { return b.last_nm < x; });
    if (band == bands_->end() || nm < band->first_nm) continue;
    (*values)[i] = static_cast<float>(band->At(nm));
  }
}

SpectralColor SpectralColor::Tabulate(const std::function<double(double nm)>& value) {
  std::vector<float> table;
  for (size_t i = 0; i < kSpectrumCount; ++i)
    table.push_back(static_cast<float>(value(TableNm(i))));
  table.push_back(table.back());
  SpectralColor made;
  made.table_ = std::make_shared<const std::vector<float>>(std::move(table));
  return made;
}

Spectral SpectralColor::At(const Wavelengths& wavelengths) const {
  if (table_ != nullptr) {
    Spectral values = Interpolate(table_->data(), wavelengths);
    if (bands_ != nullptr) SetBands(wavelengths, &values);
    return values;
  }
  const Spectral values = sigmoid_.At(wavelengths) * scale_;
  return is_under_d65_ ? values * Interpolate(SharedTables().d65.data(), wavelengths) : values;
}

float SpectralColor::At(float nm) const {
  nm = std::clamp(nm, kWavelengthMinNm, kWavelengthMaxNm);
  return At(Wavelengths{{nm, nm, nm, nm}, {}})[0];
}

Spectral Upsample(Rgb rgb, ColorRole role, const Wavelengths& wavelengths) {
  // An unreadable texel is NaN, and must reach the image's count of such samples.
  if (!IsFinite(rgb)) return Spectral::Gray(std::numeric_limits<float>::quiet_NaN());
  rgb = Admissible(rgb, role);
  const float largest = MaxComponent(rgb);
  if (largest < kLargestMin) return {};
  Spectral values = Spectral::Gray(largest);
  if (!IsGray(rgb)) {
    const float level = FitLevel(largest, role);
    values = SharedUpsampling().At(rgb, level).At(wavelengths) * (largest / level);
  }
  if (role != ColorRole::kIlluminant) return values;
  return values * Interpolate(SharedTables().d65.data(), wavelengths);
}

void PrepareUpsampling() { SharedUpsampling(); }

ObserverTable MakeObserver(const std::function<std::array<double, 3>(double nm)>& rgb) {
  ObserverTable observer{};
  for (size_t i = 0; i < kTableSize; ++i) {
    const std::array<double, 3> values = rgb(TableNm(i));
    for (size_t k = 0; k < 3; ++k) observer[i][k] = static_cast<float>(values[k]);
  }
  return observer;
}

const ObserverTable& StandardObserver() { return SharedTables().observer; }

Rgb RgbOf(const Spectral& radiance, const Wavelengths& wavelengths, const ObserverTable& observer) {
  const TablePositions at = PositionsOf(wavelengths);
  Spectral weight;
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    weight[i] = radiance[i] / (kWavelengthCount * wavelengths.pdf[i]);
  }
  std::array<float, 4> sum{};
  for (size_t i = 0; i < kWavelengthCount; ++i) {
    const auto* row = &observer[static_cast<size_t>(at.below[i])];
    const float below = weight[i] * (1 - at.part[i]), above = weight[i] * at.part[i];
    for (size_t k = 0; k < 4; ++k) sum[k] += below * row[0][k] + above * row[1][k];
  }
  return {sum[0], sum[1], sum[2]};
}

}  // namespace sheaf::render
