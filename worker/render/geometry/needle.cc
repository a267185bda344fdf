// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Needle detection, and intersection of triangles in double.
#include "worker/render/geometry/needle.h"

#include <algorithm>
#include <cmath>

#include "worker/render/geometry/ray_origin.h"

namespace sheaf::render {
namespace {

// Rounding of the single-precision edge test: of the corners relative to the ray's origin, and of
// their products. Relative to their largest coordinate.
constexpr double kEdgeRounding = Gamma(16);

double LargestCoordinate(Vec3d v) {
  return std::max(std::fabs(v.x), std::max(std::fabs(v.y), std::fabs(v.z)));
}

// A point of the triangle, relative to the ray's origin, and its distance from the line.
struct Approach {
  TriangleHit hit;
  double distance = 0;
};
Approach ApproachTo(Vec3d point, Vec3d d, double u, double v) {
  const double t = Dot(point, d) / Dot(d, d);
  return {{t, u, v, false}, Length(point - d * t)};
}

// The weight of a corner is the volume that the line spans with the opposite edge.
std::array<double, 3> VolumesOf(Vec3d d, Vec3d a, Vec3d b, Vec3d c) {
  return {Dot(d, Cross(b, c - b)), Dot(d, Cross(c, a - c)), Dot(d, Cross(a, b - a))};
}

// Fraction of the way from `from` to `to` at which the line along d passes closest.
double NearestOnEdge(Vec3d from, Vec3d to, Vec3d d) {
  const Vec3d normal = Cross(d, to - from);
  const double square = LengthSquared(normal);
  if (!(square > 0)) return 0;
  return std::clamp(Dot(Cross(from, d), normal) / square, 0.0, 1.0);
}

}  // namespace

bool HasNeedles(const std::vector<Vec3f>& positions, const std::vector<uint32_t>& indices) {
  constexpr double kSquare = kNeedleSlimness * kNeedleSlimness;
  for (size_t i = 0; i + 2 < indices.size(); i += 3) {
    const Vec3d p = ToDouble(positions[indices[i]]);
    const Vec3d e1 = ToDouble(positions[indices[i + 1]]) - p,
                e2 = ToDouble(positions[indices[i + 2]]) - p;
    const double longest =
        std::max(LengthSquared(e1), std::max(LengthSquared(e2), LengthSquared(e2 - e1)));
    if (LengthSquared(Cross(e1, e2)) < kSquare * longest * longest) return true;
  }
  return false;
}

CornerWeights CornerWeightsOf(Vec3d o, Vec3d d, const std::array<Vec3d, 3>& corners) {
  const Vec3d a = corners[0] - o, b = corners[1] - o, c = corners[2] - o;
  std::array<double, 3> weights = VolumesOf(d, a, b, c);
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

std::optional<TriangleHit> IntersectTriangle(Vec3d o, Vec3d d, const std::array<Vec3d, 3>& corners,
                                             double corner_error) {
  const Vec3d a = corners[0] - o, b = corners[1] - o, c = corners[2] - o;
  const Vec3d ab = corners[1] - corners[0], bc = corners[2] - corners[1],
              ca = corners[0] - corners[2];
  const double rounding =
      corner_error + kEdgeRounding * std::max(LargestCoordinate(a),
                                              std::max(LargestCoordinate(b), LargestCoordinate(c)));
  const auto [wa, wb, wc] = VolumesOf(d, a, b, c);
  const double sum = wa + wb + wc;
  const bool inside = (wa >= 0 && wb >= 0 && wc >= 0) || (wa <= 0 && wb <= 0 && wc <= 0);
  if (inside && sum != 0) {
    const double u = wb / sum, v = wc / sum;
    Approach approach = ApproachTo(a + ab * u - ca * v, d, u, v);
    approach.hit.is_inside = true;
    if (approach.distance <= rounding && approach.hit.t > 0) return approach.hit;
  }
  // The line is in the plane of the triangle or misses it: find the closest edge.
  const double on_ab = NearestOnEdge(a, b, d), on_bc = NearestOnEdge(b, c, d),
               on_ca = NearestOnEdge(c, a, d);
  const Approach edges[3] = {ApproachTo(a + ab * on_ab, d, on_ab, 0),
                             ApproachTo(b + bc * on_bc, d, 1 - on_bc, on_bc),
                             ApproachTo(c + ca * on_ca, d, 0, 1 - on_ca)};
  const Approach* nearest = nullptr;
  for (const Approach& edge : edges) {
    if (!(edge.distance <= rounding && edge.hit.t > 0)) continue;
    if (nearest == nullptr || edge.distance < nearest->distance) nearest = &edge;
  }
  if (nearest == nullptr) return std::nullopt;
  TriangleHit hit = nearest->hit;
  hit.is_inside = nearest->distance <= corner_error;
  return hit;
}

}  // namespace sheaf::render
