// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The primaries that a scene's rgb values are given in (directive ColorSpace, with pbrt-v4's names
// and definitions), and the way from them to the linear sRGB that Sheaf renders in; and from there
// to the primaries and the white balance of the delivered picture.
#pragma once

#include <string>

#include "common/film/picture_color.h"
#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Temperatures that a white balance may have, kelvin: from candles to the bluest sky, where the
// formula of daylight ends.
inline constexpr float kWhiteBalanceMinK = 1000, kWhiteBalanceMaxK = 25000;

// XYZ of what looks under the white `to` as it did under `from`. Source: Lam 1985 (Bradford), in
// the linear form of ICC.1:2010, annex E.
// Requires: neither has y = 0.
Matrix4 AdaptWhite(Vec2d from, Vec2d to);

// How a frame's sums become its picture. white_balance_k: 0, or the temperature of the light that
// shall look white (pbrt-v4's "whitebalance" with the sensor cie1931): Bradford's adaptation from
// it to the white of the primaries. Otherwise nothing is adapted: what is white in sRGB has the
// color of D65 in every primaries. Albedo is not adapted, and its white stays white.
// sensor: of a camera (sensor.h), or empty. Its matrix for the light and the primaries takes the
// place of the one by which its sums were made; 0 is the light of kSensorWhiteBalanceK.
PictureColor PictureColorOf(Primaries primaries, float white_balance_k,
                            const std::string& sensor = "");

// Linear sRGB of a color, by way of CIE XYZ. The white of an illuminant stays the white of its
// primaries: (1, 1, 1) of ACES is the color of D60. Of all else white is what reflects everything,
// under whatever light, so it stays (1, 1, 1) and what differs from it is scaled along, by channel.
// Components below 0 and, for reflectances, above 1 are colors outside of the gamut of sRGB.
Rgb SrgbFromPrimaries(Rgb rgb, Primaries primaries, ColorRole role);

}  // namespace sheaf
