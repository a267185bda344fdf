// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ImageColor: the primaries of a delivered image, and the conversion to them from the linear sRGB
// of the film's sums. The conversion is linear and is applied when a tile is developed, so that
// parts and their merging do not depend on it. Sources of the chromaticities: IEC 61966-2-1, SMPTE
// ST 2065-1, ITU-R BT.2020, SMPTE RP 431-2 (with D65, as pbrt-v4's), Academy S-2014-004.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/math/transform.h"
#include "common/math/vec.h"

namespace sheaf {

// The numbers are part of stored jobs: append, never change.
enum class Primaries : uint8_t { kSrgb = 0, kAces2065 = 1, kRec2020 = 2, kDciP3 = 3, kAcesCg = 4 };
inline constexpr size_t kPrimariesCount = 5;

// CIE 1931 x, y of (1, 0, 0), (0, 1, 0), (0, 0, 1) and (1, 1, 1). Those of sRGB by default, as in
// EXR files that have none.
struct Chromaticities {
  Vec2d red{0.64, 0.33}, green{0.30, 0.60}, blue{0.15, 0.06}, white{0.3127, 0.3290};
  // As files store them: in the order above, x before y.
  std::array<float, 8> AsStored() const;
  static Chromaticities FromStored(const std::array<float, 8>& xy);
  // Equal to four digits: renderers write the same white with five or six.
  friend bool operator==(const Chromaticities& a, const Chromaticities& b) {
    const std::array<float, 8> p = a.AsStored(), q = b.AsStored();
    for (size_t i = 0; i < p.size(); ++i) {
      if (!(std::fabs(p[i] - q[i]) < 5e-5f)) return false;
    }
    return true;
  }
};

// "srgb", "aces2065-1", "rec2020", "dci-p3", "acescg". Parsing ignores case.
const char* PrimariesName(Primaries primaries);
std::optional<Primaries> PrimariesFromName(const std::string& name);
std::vector<std::string> PrimariesNames();
Chromaticities ChromaticitiesOf(Primaries primaries);

// CIE XYZ of linear RGB, white having Y = 1. None if the primaries lie on a line, or if the white
// is not a combination of them with positive luminance.
std::optional<Matrix4> XyzFromRgb(const Chromaticities& chromaticities);
// Linear RGB of one set of primaries to another, by way of XYZ, without chromatic adaptation. None
// if either has no XyzFromRgb.
std::optional<Matrix4> RgbFromRgb(const Chromaticities& to, const Chromaticities& from);

// The color of an image that is developed or was read.
struct ImageColor {
  Chromaticities chromaticities;
  // Applied to the sums' linear sRGB: one for light, one for albedo, in which white stays white.
  Matrix4 light_from_srgb, albedo_from_srgb;
  // If true, the sums are not converted and keep their bits.
  bool AsSummed() const { return light_from_srgb == Matrix4() && albedo_from_srgb == Matrix4(); }
};

}  // namespace sheaf
