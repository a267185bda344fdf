// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Curves: cubic Bezier segments with a width, met in double. A ray meets one where it passes the
// centre line within half the width: as if it were a ribbon that faces every ray. See docs/adr/0015
// for why they are not the ray tracer's own. Source: Nakamaru and Ohno 2002, "Ray tracing for
// curves primitive"; pbrt-v4, sec. 6.7, whose parameters and cuts between segments these are.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/curve_set.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

// Space: that of the shape.
struct CurveSegment {
  CurveSet::Kind kind{};
  std::array<Vec3d, 4> points;  // Control points; not all the same.
  std::array<double, 2> widths{};
  std::array<Vec3d, 2> normals;  // kRibbon.

  double WidthAt(double u) const { return widths[0] * (1 - u) + widths[1] * u; }
  Vec3d PointAt(double u) const;
  // Never zero.
  Vec3d TangentAt(double u) const;
  // kRibbon: unit, turns evenly between the two ends.
  Vec3d NormalAt(double u) const;
};
CurveSegment SegmentOf(const CurveSet& curves, size_t index);

// One of `count` equal parts of a segment; count is a power of two.
struct CurvePiece {
  uint32_t segment = 0;
  uint16_t index = 0, count = 1;
};
// Segments are split in at most this many pieces, so that boxes about them hold little else. Twice
// as many would be a sixth faster and take twice the memory.
inline constexpr uint16_t kCurvePiecesMax = 4;

// A rod about a piece, for telling cheaply that a ray passes it by: most of the pieces whose boxes
// a ray meets are thin and slanted. Space: where the curves are traced. Every line that passes the
// piece within half its width passes the line through `begin` and `end` within `radius`.
struct CurveRod {
  Vec3f begin, end;
  float radius = 0;
};
CurveRod RodAbout(const CurveSegment& segment, const CurvePiece& piece, const Affine& transform);
// False where the line o + t d cannot meet what the rod is about.
inline bool MayMeet(const CurveRod& rod, Vec3d o, Vec3d d);

struct CurveHit {
  double t = 0;         // In lengths of d: of the ray's nearest point to the centre line.
  double u = 0, v = 0;  // Along the segment, and across: 0.5 on the centre line.
};
// The nearest meeting of o + t d with the piece, 0 < t < t_max.
std::optional<CurveHit> IntersectCurve(const CurveSegment& segment, const CurvePiece& piece,
                                       Vec3d o, Vec3d d, double t_max);

struct CurvePoint {
  Vec3d p;
  Vec3d n;  // Unit. Towards the ray, for cylinders turned to the sides; for ribbons their own.
  Vec3d dpdu;
  double width = 0;  // No ray meets the curve farther off its centre line than half of it.
};
// Where a ray along d met the segment. v grows along Cross(d, dpdu), as in pbrt-v4.
CurvePoint CurvePointAt(const CurveSegment& segment, double u, double v, Vec3d d);

// Axis-aligned bounds of the piece in the space that `transform` leads to, rounded outwards.
std::array<Vec3f, 2> CurveBounds(const CurveSegment& segment, const CurvePiece& piece,
                                 const Affine& transform);

// Adds the pieces the segment is worth splitting into: as long as that makes their boxes smaller.
void SplitCurve(const CurveSegment& segment, uint32_t index, const Affine& transform,
                std::vector<CurvePiece>* pieces);

inline bool MayMeet(const CurveRod& rod, Vec3d o, Vec3d d) {
  const auto sum = [](Vec3d v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); };
  const Vec3d begin = ToDouble(rod.begin);
  const Vec3d e = ToDouble(rod.end) - begin, w = begin - o, n = Cross(d, e);
  // The distance of the two lines is that of w along n. Its rounding: some of three factors each.
  const double apart = std::fabs(Dot(w, n)) - 0x1p-48 * sum(w) * sum(d) * sum(e);
  const double reach = static_cast<double>(rod.radius);
  return !(apart > 0 && apart * apart > reach * reach * LengthSquared(n));
}

// Brings segments that are near each other in space near each other in memory (Morton order of
// their middles; equal ones stay in order). Files have curves in any order, and a ray's candidates
// would each be waited for.
void SortCurves(CurveSet* curves);

}  // namespace sheaf::render
