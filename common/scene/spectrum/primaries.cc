// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/primaries.h"

#include <array>

#include "common/base/check.h"
#include "common/math/transform.h"
#include "common/scene/spectrum/sensor.h"
#include "common/scene/spectrum/spectrum.h"

namespace sheaf {
namespace {

// Named spectra of the primaries' whites, indexed by Primaries.
constexpr std::array<const char*, kPrimariesCount> kWhites{
    "stdillum-D65", "illum-acesD60", "stdillum-D65", "stdillum-D65", "illum-acesD60"};

// Linear sRGB of a light, scaled to luminance 1; may be out of gamut.
Vec3d SrgbOf(const ColorSpec& light) {
  const double luminance = SpectrumLuminance(light);
  Vec3d sum{0, 0, 0};
  for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; ++nm) {
    const std::array<double, 3> observer = ObserverRgb(nm);
    const double value = EvaluateSpectrum(light, nm) / luminance;
    sum = sum + Vec3d{observer[0], observer[1], observer[2]} * value;
  }
  return sum;
}

Vec3d SrgbOfWhite(const char* name) {
  ColorSpec white;
  white.kind = ColorSpec::Kind::kNamed;
  white.name = name;
  return SrgbOf(white);
}

struct Conversion {
  Matrix4 srgb_from_rgb;
  Vec3d white;  // The light of (1, 1, 1).
};

// The columns are the primaries, scaled such that they add up to the white.
Conversion MakeConversion(Primaries primaries) {
  Conversion conversion;
  conversion.white = SrgbOfWhite(kWhites[static_cast<size_t>(primaries)]);
  const Chromaticities xy = ChromaticitiesOf(primaries);
  const Vec2d corners[3] = {xy.red, xy.green, xy.blue};
  Matrix4 columns;
  for (size_t i = 0; i < 3; ++i) {
    const double x = corners[i].x, y = corners[i].y;
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
  static const std::array<Conversion, kPrimariesCount> conversions = [] {
    std::array<Conversion, kPrimariesCount> made;
    for (size_t i = 0; i < kPrimariesCount; ++i)
      made[i] = MakeConversion(static_cast<Primaries>(i));
    return made;
  }();
  return conversions[static_cast<size_t>(primaries)];
}

// Chromaticity of a light of the given temperature: a phase of daylight from 4000 K on, a blackbody
// below. Source: CIE 15:2004, eq. 3.3-3.4 for daylight; temperatures in the scale of 1968 (c2 =
// 0.014388 m K), whereas the daylight locus was fitted in that of 1948.
Vec2d ChromaticityOfTemperature(double temperature_k) {
  const double cct_k = temperature_k * (1.4388 / 1.4380);
  if (cct_k >= 4000) {
    const double t = 1000 / cct_k;
    const double x = cct_k <= 7000 ? ((-4.6070 * t + 2.9678) * t + 0.09911) * t + 0.244063
                                   : ((-2.0064 * t + 1.9018) * t + 0.24748) * t + 0.237040;
    return {x, (-3 * x + 2.870) * x - 0.275};
  }
  ColorSpec blackbody;
  blackbody.kind = ColorSpec::Kind::kBlackbody;
  blackbody.temperature_k = static_cast<float>(cct_k);
  const Vec3d xyz = TransformVector(*XyzFromRgb(Chromaticities()), SrgbOf(blackbody));
  const double sum = xyz.x + xyz.y + xyz.z;
  return {xyz.x / sum, xyz.y / sum};
}

// Converts a sensor's sums, which are linear sRGB balanced for kSensorWhiteBalanceK, to linear sRGB
// balanced for another light and the white of the primaries.
Matrix4 SensorBalance(const std::string& sensor, Primaries primaries, float white_balance_k) {
  const std::string white = kWhites[static_cast<size_t>(primaries)];
  if (white_balance_k == kSensorWhiteBalanceK && white == kWhites[0]) return {};
  Matrix4 sensor_from_summed;
  SHEAF_CHECK(Invert(SummedFromSensor(sensor), &sensor_from_summed));
  return SrgbFromSensor(sensor, static_cast<double>(white_balance_k), white) * sensor_from_summed;
}

}  // namespace

Matrix4 AdaptWhite(Vec2d from, Vec2d to) {
  const Matrix4 cones_from_xyz{{{{0.8951, 0.2664, -0.1614, 0},
                                 {-0.7502, 1.7135, 0.0367, 0},
                                 {0.0389, -0.0685, 1.0296, 0},
                                 {0, 0, 0, 1}}}};
  const auto cones_of = [&](Vec2d xy) {
    return TransformVector(cones_from_xyz, {xy.x / xy.y, 1, (1 - xy.x - xy.y) / xy.y});
  };
  const Vec3d before = cones_of(from), after = cones_of(to);
  Matrix4 xyz_from_cones;
  SHEAF_CHECK(Invert(cones_from_xyz, &xyz_from_cones));
  return xyz_from_cones *
         ScaleMatrix({after.x / before.x, after.y / before.y, after.z / before.z}) * cones_from_xyz;
}

ImageColor ImageColorOf(Primaries primaries, float white_balance_k, const std::string& sensor) {
  ImageColor color;
  color.chromaticities = ChromaticitiesOf(primaries);
  const Matrix4 rgb_from_srgb = *RgbFromRgb(color.chromaticities, Chromaticities());
  color.light_from_srgb = color.albedo_from_srgb = rgb_from_srgb;
  if (primaries != Primaries::kSrgb) {
    // The inverse of SrgbFromPrimaries: each channel of sRGB is relative to that of the white.
    const Matrix4 srgb_from_rgb = *RgbFromRgb(Chromaticities(), color.chromaticities);
    const Vec3d white = TransformVector(srgb_from_rgb, {1, 1, 1});
    color.albedo_from_srgb = rgb_from_srgb * ScaleMatrix(white);
  }
  if (!sensor.empty()) {
    color.light_from_srgb =
        rgb_from_srgb *
        SensorBalance(sensor, primaries,
                      white_balance_k == 0 ? kSensorWhiteBalanceK : white_balance_k);
  } else if (white_balance_k != 0) {
    Matrix4 rgb_from_xyz;
    SHEAF_CHECK(Invert(*XyzFromRgb(color.chromaticities), &rgb_from_xyz));
    const Vec2d light = ChromaticityOfTemperature(static_cast<double>(white_balance_k));
    color.light_from_srgb = rgb_from_xyz * AdaptWhite(light, color.chromaticities.white) *
                            *XyzFromRgb(Chromaticities());
  }
  return color;
}

Rgb SrgbFromPrimaries(Rgb rgb, Primaries primaries, ColorRole role) {
  if (primaries == Primaries::kSrgb) return rgb;
  const bool is_light = role == ColorRole::kIlluminant;
  // A color equal in all channels stays equal, to the bit.
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
