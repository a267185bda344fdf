// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/color_parts.h"

#include <algorithm>

namespace sheaf::render {

std::array<std::vector<float>, kColorPartCount> SplitColors(const std::vector<Rgb>& cells) {
  std::array<std::vector<float>, kColorPartCount> parts;
  const auto set = [&](ColorPart part, size_t cell, float value) {
    if (!(value > 0)) return;
    std::vector<float>& values = parts[static_cast<size_t>(part)];
    values.resize(cells.size());
    values[cell] = value;
  };
  for (size_t i = 0; i < cells.size(); ++i) {
    const Rgb color = cells[i];
    const float gray = std::min({color.r, color.g, color.b});
    set(ColorPart::kGray, i, gray);
    set(ColorPart::kRed, i, color.r - gray);
    set(ColorPart::kGreen, i, color.g - gray);
    set(ColorPart::kBlue, i, color.b - gray);
  }
  return parts;
}

template <>
Rgb PartWeight<Rgb>(ColorPart part, const NoWavelengths&) {
  switch (part) {
    case ColorPart::kGray:
      return Rgb::Gray(1);
    case ColorPart::kRed:
      return {1, 0, 0};
    case ColorPart::kGreen:
      return {0, 1, 0};
    case ColorPart::kBlue:
      return {0, 0, 1};
  }
  return {};
}

template <>
Spectral PartWeight<Spectral>(ColorPart part, const Wavelengths& wavelengths) {
  if (part == ColorPart::kGray) return Spectral::Gray(1);
  static const std::array<SpectralColor, 3> primaries = [] {
    std::array<SpectralColor, 3> colors;
    for (size_t i = 0; i < colors.size(); ++i) {
      ColorSpec primary;
      primary.rgb[i] = 1;
      colors[i] = SpectralColor::Make(primary, ColorRole::kReflectance);
    }
    return colors;
  }();
  Spectral sum, own;
  for (size_t i = 0; i < primaries.size(); ++i) {
    const Spectral reflected = primaries[i].At(wavelengths);
    sum += reflected;
    if (i + 1 == static_cast<size_t>(part)) own = reflected;
  }
  return MakeColor<Spectral>([&](size_t i) { return own[i] / sum[i]; });
}

}  // namespace sheaf::render
