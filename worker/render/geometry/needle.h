// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Needles: triangles so slim that the ray tracer's single precision cannot be believed. Its
// rounding moves a hit along a needle by the needle's length over its width, so that the distance,
// the point and even whether there is a hit come out wrong. Meshes that hold needles have their
// hits tested again in double (docs/adr/0007).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::render {

// A triangle is a needle where its least height is less than this part of its longest side. With
// stouter ones the tracer's rounding moves a hit by some 2^-15 of its distance at most.
inline constexpr double kNeedleSlimness = 0x1p-7;

// Whether any of the triangles (three indices each) is a needle.
bool HasNeedles(const std::vector<Vec3f>& positions, const std::vector<uint32_t>& indices);

struct TriangleHit {
  double t = 0;         // In lengths of d.
  double u = 0, v = 0;  // Barycentric weights of corners 1 and 2.
};

// The weights of the corners at the point where the line o + t d meets the plane of the triangle;
// none below 0, as if it were within, and all of them 1; even where the line is in the plane.
std::array<double, 3> CornerWeights(Vec3d o, Vec3d d, const std::array<Vec3d, 3>& corners);

// Where the line o + t d meets the triangle, for t > 0. Lines that pass by within single-precision
// rounding meet its edge: the tracer gives a ray on a shared edge to one of the neighbours, and
// that one must keep it, or there is a hole. t is that of the point of u and v. corner_error: how
// far the tracer's corners may be from these.
std::optional<TriangleHit> MeetTriangle(Vec3d o, Vec3d d, const std::array<Vec3d, 3>& corners,
                                        double corner_error = 0);

}  // namespace sheaf::render
