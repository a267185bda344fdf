// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PolygonCutter: cuts polygons into triangles. A polygon that its fan from the first corner covers,
// such as every convex one, is cut so; others by ear clipping. All decisions are by exact
// arithmetic on the given coordinates, so that no polygon is too narrow. Sources: Meisters 1975,
// "Polygons have ears"; Shewchuk 1997, "Adaptive precision floating-point arithmetic and fast
// robust geometric predicates", fig. 8 (sums of doubles) and sec. 4.2 (the bound of the filter).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/math/vec.h"

namespace sheaf {

// > 0 if a, b, c turn left, < 0 if they turn right, 0 if they are collinear. Exact, by its sign.
// Requires: finite coordinates.
int Orientation(Vec2f a, Vec2f b, Vec2f c);

class PolygonCutter {
 public:
  // Ears are searched among this many corners at most: the time grows with the square.
  static constexpr size_t kCornersMax = size_t{1} << 14;

  enum class Result {
    kCut,
    kCrosses,  // The edges cross, or the corners are far from any plane: a fan, as it has no
               // inside.
    kTooMany,  // More than kCornersMax corners, and no fan covers them: a fan.
  };
  // Writes corners.size() - 2 triangles over the corners, each in the polygon's direction. Those
  // of collinear corners have no area. Requires: at least 3 corners, indices of positions;
  // triangles has room, and does not overlap corners.
  Result Cut(const std::vector<Vec3f>& positions, std::span<const uint32_t> corners,
             uint32_t* triangles);

 private:
  bool Project(const std::vector<Vec3f>& positions, std::span<const uint32_t> corners);
  bool IsCoveredByFan() const;
  bool ClipEars(std::span<const uint32_t> corners, uint32_t* triangles);
  bool IsEar(uint32_t corner) const;
  uint32_t FindEar(uint32_t from, size_t left);
  int TurnAt(uint32_t corner) const;

  std::vector<Vec2f> points_;  // The corners in a coordinate plane, counter-clockwise in ClipEars.
  std::vector<uint32_t> previous_, next_;
  std::vector<uint8_t> is_ear_;
};

}  // namespace sheaf
