// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/primaries.h"

#include <array>

#include "absl/strings/match.h"
#include "common/base/check.h"
#include "common/math/transform.h"
#include "common/scene/spectrum.h"

namespace sheaf {
namespace {

struct Definition {
  Primaries primaries;
  const char* name;
  double chromaticities[3][2];
  const char* white;  // A named spectrum.
};
constexpr Definition kDefinitions[] = {
    {Primaries::kSrgb, "srgb", {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}}, "stdillum-D65"},
    {Primaries::kAces2065,
     "aces2065-1",
     {{0.7347, 0.2653}, {0, 1}, {0.0001, -0.077}},
     "illum-acesD60"},
    {Primaries::kRec2020,
     "rec2020",
     {{0.708, 0.292}, {0.170, 0.797}, {0.131, 0.046}},
     "stdillum-D65"},
    {Primaries::kDciP3, "dci-p3", {{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}}, "stdillum-D65"},
};

// Linear sRGB of a light of luminance 1, out of gamut or not.
Vec3d SrgbOfWhite(const char* name) {
  ColorSpec white;
  white.kind = ColorSpec::Kind::kNamed;
  white.name = name;
  const double luminance = SpectrumLuminance(white);
  Vec3d sum{0, 0, 0};
  for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; ++nm) {
    const std::array<double, 3> observer = ObserverRgb(nm);
    const double value = EvaluateSpectrum(white, nm) / luminance;
    sum = sum + Vec3d{observer[0], observer[1], observer[2]} * value;
  }
  return sum;
}

struct Conversion {
  Matrix4 srgb_from_rgb;
  Vec3d white;  // Of (1, 1, 1).
};

// The columns are the primaries, scaled such that they add up to the white.
Conversion MakeConversion(const Definition& definition) {
  Conversion conversion;
  conversion.white = SrgbOfWhite(definition.white);
  Matrix4 columns;
  for (size_t i = 0; i < 3; ++i) {
    const double x = definition.chromaticities[i][0], y = definition.chromaticities[i][1];
    const std::array<double, 3> rgb = SrgbFromXyz({x / y, 1, (1 - x - y) / y});
    for (size_t row = 0; row < 3; ++row) columns.m[row][i] = rgb[row];
  }
  Matrix4 inverse;
  SHEAF_CHECK(Invert(columns, &inverse));
  const Vec3d scale = TransformVector(inverse, conversion.white);
  for (size_t row = 0; row < 3; ++row) {
    for (size_t i = 0; i < 3; ++i) {
      conversion.srgb_from_rgb.m[row][i] = columns.m[row][i] * scale[i];
    }
  }
  return conversion;
}

const Conversion& ConversionOf(Primaries primaries) {
  static const std::array<Conversion, std::size(kDefinitions)> conversions = [] {
    std::array<Conversion, std::size(kDefinitions)> made;
    for (size_t i = 0; i < std::size(kDefinitions); ++i) made[i] = MakeConversion(kDefinitions[i]);
    return made;
  }();
  return conversions[static_cast<size_t>(primaries)];
}

}  // namespace

std::optional<Primaries> PrimariesFromName(const std::string& name) {
  for (const Definition& definition : kDefinitions) {
    if (absl::EqualsIgnoreCase(name, definition.name)) return definition.primaries;
  }
  return std::nullopt;
}

std::vector<std::string> PrimariesNames() {
  std::vector<std::string> names;
  for (const Definition& definition : kDefinitions) names.emplace_back(definition.name);
  return names;
}

Rgb SrgbFromPrimaries(Rgb rgb, Primaries primaries, ColorRole role) {
  if (primaries == Primaries::kSrgb) return rgb;
  const bool is_light = role == ColorRole::kIlluminant;
  // What is the same at every wavelength stays so, to the bit.
  if (!is_light && rgb.r == rgb.g && rgb.g == rgb.b) return rgb;
  const Conversion& conversion = ConversionOf(primaries);
  const Vec3d srgb = TransformVector(
      conversion.srgb_from_rgb,
      {static_cast<double>(rgb.r), static_cast<double>(rgb.g), static_cast<double>(rgb.b)});
  Rgb converted;
  for (size_t i = 0; i < 3; ++i) {
    converted[i] = static_cast<float>(is_light ? srgb[i] : srgb[i] / conversion.white[i]);
  }
  return converted;
}

}  // namespace sheaf
