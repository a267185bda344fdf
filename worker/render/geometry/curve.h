// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Curves: cubic Bezier segments with a width, intersected in double. A ray hits one where it passes
// the center line within half the width, as if the curve were a ribbon that faces every ray.
// docs/adr/0015 explains why this does not use the ray tracer's own curves. Source: Nakamaru and
// Ohno 2002, "Ray tracing for curves primitive"; pbrt-v4, sec. 6.7, for the parameters and the cuts
// between segments.
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

// Space: the shape's own.
struct CurveSegment {
  CurveSet::Kind kind{};
  std::array<Vec3d, 4> points;  // Control points; not all the same.
  std::array<double, 2> widths{};
  std::array<Vec3d, 2> normals;  // kRibbon.

  double WidthAt(double u) const { return widths[0] * (1 - u) + widths[1] * u; }
  Vec3d PointAt(double u) const;
  // Never zero.
  Vec3d TangentAt(double u) const;
  // kRibbon: unit, rotates uniformly between the two ends.
  Vec3d NormalAt(double u) const;
};
CurveSegment SegmentOf(const CurveSet& curves, size_t index);

// One of `count` equal parts of a segment; count is a power of two.
struct CurvePiece {
  uint32_t segment = 0;
  uint16_t index = 0, count = 1;
};
// Segments are split into at most this many pieces, so that boxes fit tightly. Twice as many would
// be 1/6 faster but take twice the memory.
inline constexpr uint16_t kCurvePiecesMax = 4;

// A capsule about a piece, for a cheap rejection test: most pieces whose boxes a ray hits are thin
// and diagonal. Space: that in which curves are traced. Every line that passes the piece within
// half its width passes the line through `begin` and `end` within `radius`.
struct CurveRod {
  Vec3f begin, end;
  float radius = 0;
};
CurveRod RodAbout(const CurveSegment& segment, const CurvePiece& piece, const Affine& transform);
// Returns false if the line o + t d cannot hit the piece in the rod.
inline bool MayIntersect(const CurveRod& rod, Vec3d o, Vec3d d);

struct CurveHit {
  double t = 0;         // In lengths of d: of the ray's point closest to the center line.
  double u = 0, v = 0;  // Along the segment, and across: 0.5 on the center line.
};
// Returns the nearest intersection of o + t d with the piece, 0 < t < t_max.
std::optional<CurveHit> IntersectCurve(const CurveSegment& segment, const CurvePiece& piece,
                                       Vec3d o, Vec3d d, double t_max);

struct CurvePoint {
  Vec3d p;
  Vec3d n;  // Unit. Faces the ray, for cylinders rotated towards the sides; a ribbon's own normal.
  Vec3d dpdu;
  double width = 0;  // Rays hit the curve within half of this from its center line.
};
// The point where a ray along d hit the segment. v grows along Cross(d, dpdu), as in pbrt-v4.
CurvePoint CurvePointAt(const CurveSegment& segment, double u, double v, Vec3d d);

// Axis-aligned bounds of the piece in the target space of `transform`, rounded outwards.
std::array<Vec3f, 2> CurveBounds(const CurveSegment& segment, const CurvePiece& piece,
                                 const Affine& transform);

// Adds the pieces of the segment, split as long as that makes their boxes smaller enough.
void SplitCurve(const CurveSegment& segment, uint32_t index, const Affine& transform,
                std::vector<CurvePiece>* pieces);

inline bool MayIntersect(const CurveRod& rod, Vec3d o, Vec3d d) {
  const auto sum = [](Vec3d v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); };
  const Vec3d begin = ToDouble(rod.begin);
  const Vec3d e = ToDouble(rod.end) - begin, w = begin - o, n = Cross(d, e);
  // The distance of the two lines is that of w along n. The rounding error scales with the product
  // of the three vectors.
  const double apart = std::fabs(Dot(w, n)) - 0x1p-48 * sum(w) * sum(d) * sum(e);
  const double reach = static_cast<double>(rod.radius);
  return !(apart > 0 && apart * apart > reach * reach * LengthSquared(n));
}

// Sorts segments so that neighbors in space are neighbors in memory (Morton order of their middles;
// stable). Files store curves in any order, and each candidate of a ray would be a cache miss.
void SortCurves(CurveSet* curves);

}  // namespace sheaf::render
