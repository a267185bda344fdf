// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Needles: triangles too slim for the ray tracer's single precision. Rounding moves a hit along a
// needle by a factor of its length over its width, so that the distance, the point and even the
// existence of the hit may be wrong. Hits of meshes with needles are tested again in double
// (docs/adr/0007).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/math/vec.h"

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
// Weights of the corners at the point where the line o + t d intersects the triangle's plane,
// clamped to the triangle.
CornerWeights CornerWeightsOf(Vec3d o, Vec3d d, const std::array<Vec3d, 3>& corners);

// Intersects the line o + t d with the triangle, for t > 0. Lines that pass within single-precision
// rounding hit the edge: the tracer assigns a ray on a shared edge to one of the neighbors, which
// must keep it, or there is a hole. t is that of the point at u and v. corner_error: bound of the
// distance between the tracer's corners and these.
std::optional<TriangleHit> IntersectTriangle(Vec3d o, Vec3d d, const std::array<Vec3d, 3>& corners,
                                             double corner_error = 0);

}  // namespace sheaf::render
