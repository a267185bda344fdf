// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The primaries that a scene's rgb values are given in (directive ColorSpace, with pbrt-v4's names
// and definitions), and the way from them to the linear sRGB that Sheaf renders in. Sources of the
// chromaticities: IEC 61966-2-1, SMPTE ST 2065-1, ITU-R BT.2020, SMPTE RP 431-2 (with D65).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf {

enum class Primaries : uint8_t { kSrgb, kAces2065, kRec2020, kDciP3 };

// None where it is no such name. Case does not matter.
std::optional<Primaries> PrimariesFromName(const std::string& name);
std::vector<std::string> PrimariesNames();

// Linear sRGB of a color, by way of CIE XYZ. The white of an illuminant stays the white of its
// primaries: (1, 1, 1) of ACES is the color of D60. Of all else white is what reflects everything,
// under whatever light, so it stays (1, 1, 1) and what differs from it is scaled along, by channel.
// Components below 0 and, for reflectances, above 1 are colors outside of the gamut of sRGB.
Rgb SrgbFromPrimaries(Rgb rgb, Primaries primaries, ColorRole role);

}  // namespace sheaf
