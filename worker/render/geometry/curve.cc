// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Intersection of curves in the ray's frame: halves them until they are nearly straight, then finds
// the foot of the perpendicular on them.
#include "worker/render/geometry/curve.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <type_traits>
#include <utility>

#include "common/math/elementary.h"
#include "common/math/next_float.h"
#include "worker/render/geometry/bounds.h"

namespace sheaf::render {
namespace {

using Bezier = std::array<Vec3d, 4>;

// Maximum halvings of a piece before the search for the foot. Ten give a thousandth of it.
constexpr int kHalvingsMax = 10;
// A part is straight enough if it deviates from its chord by this fraction of its width (pbrt-v4).
constexpr double kStraightness = 0.05;
// Newton steps from the foot on the chord to the foot on the part, which is nearly straight.
constexpr int kFootSteps = 3;
// Extension of a part beyond its ends, relative to its end tangents: neighbors overlap by more than
// rounding can remove.
constexpr double kEndSlack = 0x1p-30;

// Spreads the low 21 bits, with two zeros between them.
uint64_t SpreadBits(uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffff;
  v = (v | v << 16) & 0x1f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  return (v | v << 2) & 0x1249249249249249;
}

Vec3d Middle(Vec3d a, Vec3d b) { return (a + b) * 0.5; }

// De Casteljau's halving.
std::array<Bezier, 2> Halve(const Bezier& c) {
  const Vec3d a = Middle(c[0], c[1]), b = Middle(c[1], c[2]), e = Middle(c[2], c[3]);
  const Vec3d ab = Middle(a, b), be = Middle(b, e), mid = Middle(ab, be);
  return {Bezier{c[0], a, ab, mid}, Bezier{mid, be, e, c[3]}};
}
// Returns the control points of a piece. Always halves, so that neighbors agree on their ends.
Bezier PartOf(Bezier c, const CurvePiece& piece) {
  for (int half = piece.count / 2; half > 0; half /= 2) {
    c = Halve(c)[(piece.index & half) != 0 ? 1 : 0];
  }
  return c;
}

Vec3d Evaluate(const Bezier& c, double u, Vec3d* derivative, Vec3d* second = nullptr) {
  const double w = 1 - u;
  const Vec3d a = c[0] * w + c[1] * u, b = c[1] * w + c[2] * u, e = c[2] * w + c[3] * u;
  const Vec3d ab = a * w + b * u, be = b * w + e * u;
  *derivative = (be - ab) * 3.0;
  if (second != nullptr) *second = (a - b * 2.0 + e) * 6.0;
  return ab * w + be * u;
}

Vec3d AnyPerpendicular(Vec3d d) {
  size_t least = 0;
  for (size_t i = 1; i < 3; ++i) {
    if (std::fabs(d[i]) < std::fabs(d[least])) least = i;
  }
  Vec3d axis;
  axis[least] = 1;
  return Cross(d, axis);
}

double Dot2(Vec3d a, Vec3d b) { return a.x * b.x + a.y * b.y; }

// Returns the direction in which a curve that begins at c[0] leaves it; zero for a point.
Vec3d LeavingDirection(Vec3d c0, Vec3d c1, Vec3d c2, Vec3d c3) {
  for (const Vec3d& c : {c1, c2, c3}) {
    if (!(c - c0 == Vec3d{})) return c - c0;
  }
  return {};
}

// Intersects one ray with one piece. The piece is transformed to the ray's frame: x and y across
// the ray (y is also across the piece), z is t.
class CurveTracer {
 public:
  CurveTracer(const CurveSegment& segment, Vec3d d, double t_max)
      : segment_(segment), d_(d), t_max_(t_max) {}

  std::optional<CurveHit> Trace(const CurvePiece& piece, Vec3d o) {
    const Bezier part = InRayFrame(PartOf(segment_.points, piece), o);
    const double step = 1.0 / piece.count, u = piece.index * step;
    const double width = std::max(segment_.WidthAt(u), segment_.WidthAt(u + step));
    double bend = 0;  // Upper bound of the part's deviation from its chord.
    for (size_t i = 0; i < 2; ++i) {
      const Vec3d second = part[i] - part[i + 1] * 2.0 + part[i + 2];
      bend = std::max(bend, std::max(std::fabs(second.x), std::fabs(second.y)));
    }
    bend *= 6 * std::numbers::sqrt2 / 8;
    int halvings = 0;
    while (bend > kStraightness * width && halvings < kHalvingsMax) {
      bend *= 0.25;
      ++halvings;
    }
    Visit(part, u, u + step, halvings);
    return nearest_;
  }

 private:
  Bezier InRayFrame(const Bezier& c, Vec3d o) const {
    Vec3d y = Cross(d_, c[3] - c[0]);
    if (LengthSquared(y) == 0) y = AnyPerpendicular(d_);
    y = Normalize(y);
    const double length_squared = LengthSquared(d_);
    const Vec3d x = Cross(y, d_) * (1 / std::sqrt(length_squared));
    const Vec3d z = d_ * (1 / length_squared);
    Bezier result;
    for (size_t i = 0; i < 4; ++i) {
      const Vec3d p = c[i] - o;
      result[i] = {Dot(x, p), Dot(y, p), Dot(z, p)};
    }
    return result;
  }

  bool MayIntersect(const Bezier& c, double u0, double u1) const {
    const double reach = 0.5 * std::max(segment_.WidthAt(u0), segment_.WidthAt(u1));
    Vec3d lower = c[0], upper = c[0];
    for (size_t i = 1; i < 4; ++i) {
      for (size_t k = 0; k < 3; ++k) {
        lower[k] = std::min(lower[k], c[i][k]);
        upper[k] = std::max(upper[k], c[i][k]);
      }
    }
    return lower.x <= reach && upper.x >= -reach && lower.y <= reach && upper.y >= -reach &&
           upper.z > 0 && lower.z < t_max_;
  }

  void Visit(const Bezier& c, double u0, double u1, int halvings) {
    if (!MayIntersect(c, u0, u1)) return;
    if (halvings == 0) return IntersectStraight(c, u0, u1);
    const std::array<Bezier, 2> halves = Halve(c);
    const double middle = 0.5 * (u0 + u1);
    Visit(halves[0], u0, middle, halvings - 1);
    Visit(halves[1], middle, u1, halvings - 1);
  }

  void IntersectStraight(const Bezier& c, double u0, double u1) {
    // Cuts perpendicular to the curve at both ends, which neighbors share.
    const Vec3d begin = LeavingDirection(c[0], c[1], c[2], c[3]);
    const Vec3d end = LeavingDirection(c[3], c[2], c[1], c[0]);
    if (Dot2(begin, c[0]) > kEndSlack * Dot2(begin, begin)) return;
    if (Dot2(end, c[3]) > kEndSlack * Dot2(end, end)) return;
    const Vec3d chord = c[3] - c[0];
    const double chord_squared = Dot2(chord, chord);
    if (chord_squared == 0) return;  // The curve is seen end on.
    double w = std::clamp(-Dot2(c[0], chord) / chord_squared, 0.0, 1.0);
    Vec3d tangent, second;
    Vec3d center = Evaluate(c, w, &tangent, &second);
    for (int i = 0; i < kFootSteps; ++i) {
      const double slope = Dot2(tangent, tangent) + Dot2(center, second);
      if (slope > 0) w = std::clamp(w - Dot2(center, tangent) / slope, 0.0, 1.0);
      center = Evaluate(c, w, &tangent, &second);
    }
    const double u = u0 * (1 - w) + u1 * w;
    double width = segment_.WidthAt(u);
    if (segment_.kind == CurveSet::Kind::kRibbon) {
      width *= std::fabs(Dot(segment_.NormalAt(u), d_)) / Length(d_);
    }
    const double off_squared = Dot2(center, center);
    if (!(4 * off_squared < width * width)) return;
    if (!(center.z > 0 && center.z < t_max_)) return;
    const double off = std::sqrt(off_squared) / width;
    const bool is_left = tangent.y * center.x - tangent.x * center.y > 0;
    t_max_ = center.z;
    nearest_ = CurveHit{center.z, u, is_left ? 0.5 + off : 0.5 - off};
  }

  const CurveSegment& segment_;
  Vec3d d_;
  double t_max_;
  std::optional<CurveHit> nearest_;
};

}  // namespace

Vec3d CurveSegment::PointAt(double u) const {
  Vec3d derivative;
  return Evaluate(points, u, &derivative);
}

Vec3d CurveSegment::TangentAt(double u) const {
  Vec3d derivative;
  Evaluate(points, u, &derivative);
  if (LengthSquared(derivative) > 0) return derivative;
  // Coincident control points: use the direction of the curve beyond them.
  return u < 0.5 ? LeavingDirection(points[0], points[1], points[2], points[3])
                 : -LeavingDirection(points[3], points[2], points[1], points[0]);
}

Vec3d CurveSegment::NormalAt(double u) const {
  const double angle = Atan2(Length(Cross(normals[0], normals[1])), Dot(normals[0], normals[1]));
  const double sine = Sin(angle);
  // Equal normals, or opposite ones, for which the direction of rotation is undefined.
  if (sine < 0x1p-20) return normals[u < 0.5 ? 0 : 1];
  const Vec3d n = (normals[0] * Sin((1 - u) * angle) + normals[1] * Sin(u * angle)) * (1 / sine);
  return Normalize(n);
}

CurveSegment SegmentOf(const CurveSet& curves, size_t index) {
  CurveSegment segment;
  segment.kind = curves.kind;
  for (size_t i = 0; i < 4; ++i) segment.points[i] = ToDouble(curves.points[4 * index + i]);
  for (size_t i = 0; i < 2; ++i) {
    segment.widths[i] = static_cast<double>(curves.widths[2 * index + i]);
    if (!curves.normals.empty()) segment.normals[i] = ToDouble(curves.normals[2 * index + i]);
  }
  return segment;
}

std::optional<CurveHit> IntersectCurve(const CurveSegment& segment, const CurvePiece& piece,
                                       Vec3d o, Vec3d d, double t_max) {
  return CurveTracer(segment, d, t_max).Trace(piece, o);
}

CurvePoint CurvePointAt(const CurveSegment& segment, double u, double v, Vec3d d) {
  CurvePoint point;
  point.dpdu = segment.TangentAt(u);
  point.width = segment.WidthAt(u);
  Vec3d across = Cross(d, point.dpdu);
  if (LengthSquared(across) == 0) across = AnyPerpendicular(point.dpdu);
  across = Normalize(across);
  const Vec3d facing = Normalize(Cross(across, point.dpdu));
  double width = point.width;
  point.n = facing;
  if (segment.kind == CurveSet::Kind::kCylinder) {
    const SinCosPair<double> turn = SinCos((v - 0.5) * kPi);
    point.n = facing * turn.cos + across * turn.sin;
  } else if (segment.kind == CurveSet::Kind::kRibbon) {
    const Vec3d normal = segment.NormalAt(u);
    width *= std::fabs(Dot(normal, d)) / Length(d);
    const Vec3d n = normal - point.dpdu * (Dot(point.dpdu, normal) / LengthSquared(point.dpdu));
    if (LengthSquared(n) > 0) point.n = Normalize(n);
  }
  point.p = segment.PointAt(u) + across * ((v - 0.5) * width);
  return point;
}

std::array<Vec3f, 2> CurveBounds(const CurveSegment& segment, const CurvePiece& piece,
                                 const Affine& transform) {
  const double step = 1.0 / piece.count, u = piece.index * step;
  const double reach = 0.5 * std::max(segment.WidthAt(u), segment.WidthAt(u + step));
  Vec3d lower, upper;
  bool is_first = true;
  // A curve lies within the convex hull of its control points.
  for (const Vec3d& control : PartOf(segment.points, piece)) {
    const Vec3d p = transform.Point(control);
    for (size_t i = 0; i < 3; ++i) {
      lower[i] = is_first ? p[i] : std::min(lower[i], p[i]);
      upper[i] = is_first ? p[i] : std::max(upper[i], p[i]);
    }
    is_first = false;
  }
  std::array<Vec3f, 2> bounds;
  for (size_t i = 0; i < 3; ++i) {
    // The extent of the transformed ball about the center line.
    const double swell = reach * Length(Vec3d{transform.x[i], transform.y[i], transform.z[i]});
    bounds[0][i] = NextDown(static_cast<float>(lower[i] - swell));
    bounds[1][i] = NextUp(static_cast<float>(upper[i] + swell));
  }
  return bounds;
}

CurveRod RodAbout(const CurveSegment& segment, const CurvePiece& piece, const Affine& transform) {
  const Bezier part = PartOf(segment.points, piece);
  CurveRod rod{ToFloat(transform.Point(part[0])), ToFloat(transform.Point(part[3])), HUGE_VALF};
  const Vec3d begin = ToDouble(rod.begin), along = ToDouble(rod.end) - begin;
  const double length = Length(along);
  if (!(length > 0)) return rod;
  // The curve lies within the convex hull of its control points.
  double bend = 0;
  for (const Vec3d& control : part) {
    bend = std::max(bend, Length(Cross(transform.Point(control) - begin, along)) / length);
  }
  const double step = 1.0 / piece.count, u = piece.index * step;
  const double reach = 0.5 * std::max(segment.WidthAt(u), segment.WidthAt(u + step));
  // No vector is stretched by more than the Frobenius norm.
  const double stretch = std::sqrt(LengthSquared(transform.x) + LengthSquared(transform.y) +
                                   LengthSquared(transform.z));
  // A margin of 0.1 % far exceeds the rounding of all these.
  rod.radius = NextUp(static_cast<float>((bend + reach * stretch) * 1.001));
  return rod;
}

void SortCurves(CurveSet* curves) {
  const auto middle_of = [curves](size_t i) {
    return ToDouble(curves->points[4 * i]) + ToDouble(curves->points[4 * i + 3]);
  };
  Bounds bounds;
  for (size_t i = 0; i < curves->size(); ++i) bounds.Add(middle_of(i));
  if (bounds.empty()) return;
  struct Key {
    uint64_t code;
    size_t index;
  };
  std::vector<Key> order(curves->size());
  constexpr double kCells = 1 << 21;  // 21 bits for each of three coordinates make 63.
  const Vec3d size = bounds.upper() - bounds.lower();
  for (size_t i = 0; i < order.size(); ++i) {
    const Vec3d offset = middle_of(i) - bounds.lower();
    order[i] = {0, i};
    for (size_t k = 0; k < 3; ++k) {
      const double cell = size[k] > 0 ? offset[k] / size[k] * kCells : 0;
      order[i].code |= SpreadBits(static_cast<uint64_t>(std::min(cell, kCells - 1))) << k;
    }
  }
  std::sort(order.begin(), order.end(), [](const Key& a, const Key& b) {
    return a.code != b.code ? a.code < b.code : a.index < b.index;
  });
  const auto sort_by = [&order](size_t stride, auto* values) {
    if (values->empty()) return;
    std::remove_reference_t<decltype(*values)> sorted;
    sorted.reserve(values->size());
    for (const Key& key : order) {
      const auto first = values->begin() + static_cast<ptrdiff_t>(stride * key.index);
      sorted.insert(sorted.end(), first, first + static_cast<ptrdiff_t>(stride));
    }
    *values = std::move(sorted);
  };
  sort_by(4, &curves->points);
  sort_by(2, &curves->widths);
  sort_by(2, &curves->normals);
}

void SplitCurve(const CurveSegment& segment, uint32_t index, const Affine& transform,
                std::vector<CurvePiece>* pieces) {
  // Minimum fraction of the boxes' surface area that halving must save: a diagonal hair is halved,
  // one along an axis is not.
  constexpr double kGainMin = 0.3;
  double area_before = HUGE_VAL;
  uint16_t count = 1;
  for (uint16_t n = 1; n <= kCurvePiecesMax; n = static_cast<uint16_t>(2 * n)) {
    double area = 0;
    for (uint16_t i = 0; i < n; ++i) {
      const std::array<Vec3f, 2> box = CurveBounds(segment, {index, i, n}, transform);
      const Vec3d size = ToDouble(box[1]) - ToDouble(box[0]);
      area += size.x * size.y + size.y * size.z + size.z * size.x;
    }
    if (n > 1 && !(area < (1 - kGainMin) * area_before)) break;
    area_before = area;
    count = n;
  }
  for (uint16_t i = 0; i < count; ++i) pieces->push_back({index, i, count});
}

}  // namespace sheaf::render
