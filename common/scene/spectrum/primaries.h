// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The primaries of a scene's rgb values (directive ColorSpace, with pbrt-v4's names and
// definitions), and their conversion to the linear sRGB that Sheaf renders in; and from there to
// the primaries and the white balance of the delivered image.
#pragma once

#include <string>

#include "common/film/image_color.h"
#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Range of white balance temperatures, kelvin: from candles to the bluest sky, where the daylight
// formula ends.
inline constexpr float kWhiteBalanceMinK = 1000, kWhiteBalanceMaxK = 25000;

// Maps XYZ seen under the white `from` to the XYZ that looks the same under the white `to`. Source:
// Lam 1985 (Bradford), in the linear form of ICC.1:2010, annex E.
// Requires: neither has y = 0.
Matrix4 AdaptWhite(Vec2d from, Vec2d to);

// How the sums of a frame become its image. white_balance_k: 0, or the temperature of the light
// that should look white (pbrt-v4's "whitebalance" with the sensor cie1931): Bradford adaptation
// from it to the white of the primaries. At 0 nothing is adapted: white in sRGB has the color of
// D65 in all primaries. Albedo is not adapted, and its white stays white. sensor: of a camera
// (sensor.h), or empty. Its matrix for the light and the primaries replaces the matrix by which its
// sums were made; then 0 means the light of kSensorWhiteBalanceK.
ImageColor ImageColorOf(Primaries primaries, float white_balance_k, const std::string& sensor = "");

// Linear sRGB of a color, by way of CIE XYZ. The white of an illuminant stays the white of its
// primaries: (1, 1, 1) of ACES is the color of D60. In all other roles white means full reflection
// under any light, so (1, 1, 1) stays (1, 1, 1) and all colors are scaled along with it, by
// channel. Components below 0 and, for reflectances, above 1 are colors outside of the gamut of
// sRGB.
Rgb SrgbFromPrimaries(Rgb rgb, Primaries primaries, ColorRole role);

}  // namespace sheaf
