// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmissionPlace: a ray of a light as a point of the unit cube of four dimensions, and the maps of
// areas that make it. Facts about the rays of a light are learned for boxes of this
// cube, so its axes should be smooth in position and direction, and uniform places should be the
// light's own choice of rays where that has a closed form:
//
//   light                  position                           direction
//   triangle, disk         on it, uniform                     about the normal, by the cosine
//   sphere                 on its disk perpendicular to the   uniform
//                          ray, uniform
//   without size           none                               uniform
//   distant                on the scene's disk                none
//                          perpendicular to the ray
//   at infinity            the same                           uniform
//   behind a portal        on the portal                      about its axis, by the cosine
//   emission of media      none                               uniform
//
// Two-sided surfaces have one side in each half of the first axis of directions (a sphere, of
// positions). Source of the map of disks: Shirley and Chiu 1997, "A Low Distortion Map Between Disk
// and Square".
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "common/math/elementary.h"
#include "common/math/vec.h"

namespace sheaf::render {

// Axes: position x, y, direction x, y; each in [0, 1).
inline constexpr size_t kEmissionAxes = 4;
// The largest number below 1.
inline constexpr double kPlaceMost = 1 - 0x1p-53;
struct EmissionPlace {
  std::array<double, kEmissionAxes> u{0.5, 0.5, 0.5, 0.5};
  Vec2d position() const { return {u[0], u[1]}; }
  Vec2d direction() const { return {u[2], u[3]}; }
};
// Which of the axes tell rays of a light apart.
struct EmissionAxes {
  bool position = true, direction = true;
  bool Has(size_t axis) const { return axis < 2 ? position : direction; }
};

// From the unit square to the unit disk, equal areas on equal areas.
inline Vec2d SquareToDisk(Vec2d square) {
  const double a = 2 * square.x - 1, b = 2 * square.y - 1;
  if (a == 0 && b == 0) return {0, 0};
  if (std::fabs(a) > std::fabs(b)) {
    const SinCosPair<double> turn = SinCos((kPi / 4) * (b / a));
    return {a * turn.cos, a * turn.sin};
  }
  const SinCosPair<double> turn = SinCos((kPi / 4) * (a / b));
  return {b * turn.sin, b * turn.cos};
}
// Its inverse; a point outside of the disk gives one of the square's border.
inline Vec2d DiskToSquare(Vec2d disk) {
  const double r = std::fmin(1.0, std::sqrt(disk.x * disk.x + disk.y * disk.y));
  if (!(r > 0)) return {0.5, 0.5};
  if (std::fabs(disk.x) > std::fabs(disk.y)) {
    const double a = std::copysign(r, disk.x);
    return {0.5 * (a + 1), 0.5 * (a * (4 / kPi) * Atan(disk.y / disk.x) + 1)};
  }
  const double b = std::copysign(r, disk.y);
  return {0.5 * (b * (4 / kPi) * Atan(disk.x / disk.y) + 1), 0.5 * (b + 1)};
}

}  // namespace sheaf::render
