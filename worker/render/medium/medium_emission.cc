// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/medium_emission.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/math/elementary.h"
#include "common/scene/spectrum/spectrum.h"

namespace sheaf::render {
namespace {

// RGB as a function of the logarithm of the temperature.
class BlackbodyTable {
 public:
  BlackbodyTable() {
    std::array<std::array<double, 3>, kSpectrumCount> observer;
    for (size_t i = 0; i < kSpectrumCount; ++i) {
      observer[i] = ObserverRgb(kSpectrumFirstNm + static_cast<double>(i));
    }
    for (size_t row = 0; row < kRows; ++row) {
      const auto kelvin = static_cast<float>(
          kFirstK * Exp(kOctaves * kLn2 * static_cast<double>(row) / (kRows - 1)));
      std::array<double, 3> sum{};
      for (size_t i = 0; i < kSpectrumCount; ++i) {
        const auto nm = static_cast<float>(kSpectrumFirstNm + static_cast<int>(i));
        const auto value = static_cast<double>(BlackbodyOfPeakOne(kelvin, nm));
        for (size_t c = 0; c < 3; ++c) sum[c] += value * observer[i][c];
      }
      for (size_t c = 0; c < 3; ++c) rows_[row][c] = static_cast<float>(std::max(sum[c], 0.0));
    }
  }
  Rgb At(float kelvin) const {
    const double octaves = Log(static_cast<double>(kelvin) / kFirstK) / kLn2;
    const double at = std::clamp(octaves / kOctaves, 0.0, 1.0) * (kRows - 1);
    const size_t row = std::min(static_cast<size_t>(at), kRows - 2);
    const auto t = static_cast<float>(at - static_cast<double>(row));
    return rows_[row] * (1 - t) + rows_[row + 1] * t;
  }

 private:
  static constexpr double kFirstK = 100, kOctaves = 10, kLn2 = 0.69314718055994531;
  static constexpr size_t kRows = 4097;
  std::vector<Rgb> rows_ = std::vector<Rgb>(kRows);
};

}  // namespace

float BlackbodyOfPeakOne(float temperature_k, float wavelength_nm) {
  if (!(temperature_k > 0)) return 0;
  // Planck's law relative to its peak, by the ratio of the peak's wavelength to this one (Wien).
  constexpr double kPeakNmK = 2.8977721e6, kPeak = 4.965114231744276, kExpm1OfPeak = 142.32492;
  const double ratio =
      kPeakNmK / (static_cast<double>(temperature_k) * static_cast<double>(wavelength_nm));
  if (ratio > 140) return 0;  // Where exp overflows.
  const double square = ratio * ratio;
  return static_cast<float>(square * square * ratio * kExpm1OfPeak / Expm1(kPeak * ratio));
}

Rgb BlackbodyRgbOfPeakOne(float temperature_k) {
  static const BlackbodyTable table;
  return temperature_k > 0 ? table.At(temperature_k) : Rgb{};
}

MediumEmission::MediumEmission(const Affine& render_from_medium, const ColorSpec& radiance,
                               float scale, bool spectral)
    : render_from_medium_(render_from_medium), scale_(scale), radiance_(radiance.rgb) {
  if (spectral) spectrum_ = SpectralColor::Make(radiance, ColorRole::kIlluminant);
}

MediumEmission::Grid MediumEmission::Placed(VolumeGrid grid) const {
  const Affine index_from_render =
      Inverse(render_from_medium_ * AffineOf(grid.medium_from_index()));
  return {std::move(grid), index_from_render};
}

float MediumEmission::Grid::At(Vec3d p) const {
  VolumeGrid::Cursor cursor(values);
  return values.At(index_from_render.Point(p), &cursor);
}

Vec3f MediumEmission::Grid::VectorAt(Vec3d p) const {
  VolumeGrid::Cursor cursor(values);
  return values.VectorAt(index_from_render.Point(p), &cursor);
}

void MediumEmission::SetTemperatures(VolumeGrid grid, const TemperatureEmission& emission) {
  SHEAF_CHECK(!grid.is_vector());
  temperatures_ = Placed(std::move(grid));
  emission_ = emission;
  BlackbodyRgbOfPeakOne(kEmissionTemperatureMinK);  // Builds the table before rendering.
}

void MediumEmission::SetFactors(VolumeGrid grid) {
  SHEAF_CHECK(!grid.is_vector());
  factors_ = Placed(std::move(grid));
}
void MediumEmission::SetColors(VolumeGrid grid) {
  SHEAF_CHECK(grid.is_vector());
  colors_ = Placed(std::move(grid));
}

template <typename Color>
Color MediumEmission::At(Vec3d p, const WavelengthsOf<Color>& wavelengths) const {
  const float scale = factors_ ? scale_ * std::max(factors_->At(p), 0.0f) : scale_;
  if (!(scale > 0)) return {};
  if (colors_) {
    const Vec3f c = colors_->VectorAt(p);
    return ColorOfRgb<Color>(Rgb{c.x, c.y, c.z} * scale, ColorRole::kIlluminant, wavelengths);
  }
  if (!temperatures_) {
    if constexpr (std::is_same_v<Color, Spectral>) {
      return spectrum_.At(wavelengths) * scale;
    } else {
      return radiance_ * scale;
    }
  }
  const float kelvin = emission_.KelvinOf(temperatures_->At(p));
  if (!(kelvin > kEmissionTemperatureMinK)) return {};
  if constexpr (std::is_same_v<Color, Spectral>) {
    return MakeColor<Color>(
        [&](size_t i) { return scale * BlackbodyOfPeakOne(kelvin, wavelengths.nm[i]); });
  } else {
    return BlackbodyRgbOfPeakOne(kelvin) * scale;
  }
}
template Rgb MediumEmission::At<Rgb>(Vec3d, const NoWavelengths&) const;
template Spectral MediumEmission::At<Spectral>(Vec3d, const Wavelengths&) const;

uint64_t MediumEmission::memory_bytes() const {
  return (temperatures_ ? temperatures_->values.memory_bytes() : 0) +
         (factors_ ? factors_->values.memory_bytes() : 0) +
         (colors_ ? colors_->values.memory_bytes() : 0);
}

}  // namespace sheaf::render
