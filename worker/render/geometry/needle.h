// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Needles: triangles too slim for the ray tracer's single precision. Rounding moves a hit along a
// needle by a factor of its length over its width, so that the distance, the point and even the
// existence of the hit may be wrong. Hits of meshes with needles are tested again in double
// (docs/adr/0007).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/geometry/ray_origin.h"

namespace sheaf::render {

// A triangle is a needle if its smallest height is less than this fraction of its longest side. For
// other triangles the tracer's rounding moves a hit by at most about 2^-15 of its distance.
inline constexpr double kNeedleSlimness = 0x1p-7;

// Whether any of the triangles (three indices each) is a needle.
bool HasNeedles(const std::vector<Vec3f>& positions, const std::vector<uint32_t>& indices);

struct TriangleHit {
  double t = 0;         // In lengths of d.
  double u = 0, v = 0;  // Barycentric weights of corners 1 and 2.
  // The line passes through the triangle, as far as its corners are known; else beside it, within
  // rounding.
  bool is_inside = false;
};

struct CornerWeights {
  std::array<double, 3> weights{};  // Nonnegative, with sum 1.
  bool is_inside = false;           // The line passes through the triangle or is in its plane.
};

namespace internal {
// The weight of a corner is the volume that the line spans with the opposite edge.
inline std::array<double, 3> VolumesOf(Vec3d d, Vec3d a, Vec3d b, Vec3d c) {
  return {Dot(d, Cross(b, c - b)), Dot(d, Cross(c, a - c)), Dot(d, Cross(a, b - a))};
}
}  // namespace internal

// Weights of the corners at the point where the line o + t d intersects the triangle's plane,
// clamped to the triangle. Inline: most callers need two of them.
inline CornerWeights CornerWeightsOf(Vec3d o, Vec3d d, const std::array<Vec3d, 3>& corners) {
  const Vec3d a = corners[0] - o, b = corners[1] - o, c = corners[2] - o;
  std::array<double, 3> weights = internal::VolumesOf(d, a, b, c);
  const double sign = weights[0] + weights[1] + weights[2] < 0 ? -1 : 1;
  double sum = 0;
  bool is_inside = true;
  for (double& weight : weights) {
    is_inside &= sign * weight >= 0;
    sum += weight = std::max(0.0, sign * weight);
  }
  if (!(sum > 0)) return {{1.0 / 3, 1.0 / 3, 1.0 / 3}, true};
  for (double& weight : weights) weight /= sum;
  return {weights, is_inside};
}

namespace internal {
// Rounding of the single-precision edge test: of the corners relative to the ray's origin, and of
// their products. Relative to their largest coordinate.
inline constexpr double kEdgeRounding = Gamma(16);

inline double LargestCoordinate(Vec3d v) {
  return std::max(std::fabs(v.x), std::max(std::fabs(v.y), std::fabs(v.z)));
}

// A point of the triangle, relative to the ray's origin, and its distance from the line.
struct Approach {
  TriangleHit hit;
  double distance = 0;
};
inline Approach ApproachTo(Vec3d point, Vec3d d, double u, double v) {
  const double t = Dot(point, d) / Dot(d, d);
  return {{t, u, v, false}, Length(point - d * t)};
}

// The point of the edges that is nearest to the line along d through the origin, if it is within
// rounding.
std::optional<TriangleHit> HitEdge(Vec3d d, const std::array<Vec3d, 3>& corners_from_o, Vec3d ab,
                                   Vec3d bc, Vec3d ca, double rounding, double corner_error);
}  // namespace internal

// Intersects the line o + t d with the triangle, for t > 0. Lines that pass within single-precision
// rounding hit the edge: the tracer assigns a ray on a shared edge to one of the neighbors, which
// must keep it, or there is a hole. t is that of the point at u and v. corner_error: bound of the
// distance between the tracer's corners and these.
[[gnu::always_inline]] inline std::optional<TriangleHit> IntersectTriangle(
    Vec3d o, Vec3d d, const std::array<Vec3d, 3>& corners, double corner_error = 0) {
  const Vec3d a = corners[0] - o, b = corners[1] - o, c = corners[2] - o;
  const Vec3d ab = corners[1] - corners[0], ca = corners[0] - corners[2];
  const double largest =
      std::max(internal::LargestCoordinate(a),
               std::max(internal::LargestCoordinate(b), internal::LargestCoordinate(c)));
  const double rounding = corner_error + internal::kEdgeRounding * largest;
  const auto [wa, wb, wc] = internal::VolumesOf(d, a, b, c);
  const double sum = wa + wb + wc;
  const bool inside = (wa >= 0 && wb >= 0 && wc >= 0) || (wa <= 0 && wb <= 0 && wc <= 0);
  if (inside && sum != 0) {
    const double u = wb / sum, v = wc / sum;
    const internal::Approach approach = internal::ApproachTo(a + ab * u - ca * v, d, u, v);
    if (approach.distance <= rounding && approach.hit.t > 0) {
      return TriangleHit{approach.hit.t, u, v, true};
    }
  }
  // The line is in the plane of the triangle or misses it.
  const Vec3d bc = corners[2] - corners[1];
  return internal::HitEdge(d, {a, b, c}, ab, bc, ca, rounding, corner_error);
}

}  // namespace sheaf::render
