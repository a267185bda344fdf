// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Needle detection, and intersection of triangles in double.
#include "worker/render/geometry/needle.h"

#include <algorithm>
#include <cmath>

namespace sheaf::render {
namespace {

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

std::optional<TriangleHit> internal::HitEdge(Vec3d d, const std::array<Vec3d, 3>& corners_from_o,
                                             Vec3d ab, Vec3d bc, Vec3d ca, double rounding,
                                             double corner_error) {
  const auto [a, b, c] = corners_from_o;
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
