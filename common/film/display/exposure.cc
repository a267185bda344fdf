// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/display/exposure.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/display/select_channels.h"

namespace sheaf {
namespace {

constexpr double kStopsStep = 0.01;

// Luminance of each pixel that is neither black nor without a finite value.
std::vector<double> Luminances(const FrameImage& image) {
  const std::vector<float>* red = image.Find("R");
  const std::vector<float>* green = image.Find("G");
  const std::vector<float>* blue = image.Find("B");
  SHEAF_CHECK(red != nullptr && green != nullptr && blue != nullptr);
  std::optional<Matrix4> xyz_from_rgb = XyzFromRgb(image.color.chromaticities);
  if (!xyz_from_rgb) xyz_from_rgb = XyzFromRgb(Chromaticities());
  const auto& weight = xyz_from_rgb->m[1];
  std::vector<double> luminances;
  luminances.reserve(red->size());
  for (size_t i = 0; i < red->size(); ++i) {
    const double y = weight[0] * (*red)[i] + weight[1] * (*green)[i] + weight[2] * (*blue)[i];
    if (y > 0 && std::isfinite(y)) luminances.push_back(y);
  }
  return luminances;
}

}  // namespace

absl::StatusOr<Exposure> ParseExposure(const std::string& text) {
  if (text.empty()) return Exposure();
  if (text == kAutomaticExposure) return Exposure{.is_automatic = true};
  double stops = 0;
  if (absl::SimpleAtod(text, &stops) && std::abs(stops) <= kStopsMax) {
    return Exposure{.stops = stops};
  }
  return absl::InvalidArgumentError(absl::StrCat("expected \"auto\" or a number of stops from -",
                                                 kStopsMax, " to ", kStopsMax, ", got \"", text,
                                                 "\""));
}

double AutomaticStops(const FrameImage& image) {
  std::vector<double> luminances = Luminances(image);
  if (luminances.empty()) return 0;
  double sum = 0;
  for (const double y : luminances) sum += std::log2(y);
  const double average = sum / static_cast<double>(luminances.size());
  const auto rank =
      static_cast<size_t>((1 - kSaturatedFraction) * static_cast<double>(luminances.size() - 1));
  const auto bright = luminances.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(luminances.begin(), bright, luminances.end());
  const double stops = std::min(std::log2(kMiddleGray) - average, -std::log2(*bright));
  return std::clamp(std::round(stops / kStopsStep) * kStopsStep, -kStopsMax, kStopsMax);
}

FrameImage Exposed(const FrameImage& image, double stops) {
  absl::StatusOr<FrameImage> exposed = SelectChannels(image, kColorChannels, kColorChannels);
  SHEAF_CHECK(exposed.ok());
  const auto factor = static_cast<float>(std::exp2(stops));
  for (std::vector<float>& plane : exposed->planes) {
    for (float& value : plane) value *= factor;
  }
  return *std::move(exposed);
}

}  // namespace sheaf
