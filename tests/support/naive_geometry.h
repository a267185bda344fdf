// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Common formulas of geometry in single precision. docs/hard-cases.md says for each row where the
// formula breaks down; tests record their results beside the expected values (hard_case.h).
#pragma once

#include <cmath>
#include <limits>

#include "common/math/vec.h"

namespace sheaf::naive {

inline constexpr float kEpsilon = 1e-4f;

// G1, G9, G10: the origin of a ray that leaves p to the side of d, by a fixed offset.
inline Vec3f OffsetOrigin(Vec3f p, Vec3f n, Vec3f d) {
  return p + n * (Dot(n, d) < 0 ? -kEpsilon : kEpsilon);
}

// G2: whether a ray that leaves a wall of a room of this size by a fixed offset starts inside it.
inline bool StartsInRoom(float size) {
  const float origin = kEpsilon - size;
  return origin > -size && origin < size;
}

// G3, G4: whether the ray o + t d hits the triangle. Source: Möller and Trumbore 1997.
inline bool IntersectsTriangle(Vec3f o, Vec3f d, Vec3f a, Vec3f b, Vec3f c) {
  const Vec3f e1 = b - a, e2 = c - a, p = Cross(d, e2), s = o - a, q = Cross(s, e1);
  const float inverse = 1 / Dot(e1, p);
  const float u = Dot(s, p) * inverse, v = Dot(d, q) * inverse;
  return u >= 0 && v >= 0 && u + v <= 1 && Dot(e2, q) * inverse > 0;
}

// G5, L13: the unit vector along v.
inline Vec3f Unit(Vec3f v) { return v * (1 / std::sqrt(Dot(v, v))); }

// G6: whether a coordinate is refused as out of range.
inline bool IsOutOfRange(float v) {
  return v > std::numeric_limits<float>::max() || v < -std::numeric_limits<float>::max();
}

// G8: the fraction of light that a white surface reflects under a constant sky, by directions about
// the shading normal n (Malley's method) without those below the surface, whose normal is y.
inline float FurnaceAbout(Vec3f n) {
  constexpr int kSide = 256;
  const Vec3f x = Unit(Cross(n, std::fabs(n.z) < 0.5f ? Vec3f{0, 0, 1} : Vec3f{1, 0, 0}));
  const Vec3f y = Cross(n, x);
  int above = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const float u = (static_cast<float>(i / kSide) + 0.5f) / kSide;
    const float phi = 6.2831853f * (static_cast<float>(i % kSide) + 0.5f) / kSide;
    const float r = std::sqrt(u);
    const Vec3f w = x * (r * std::cos(phi)) + y * (r * std::sin(phi)) + n * std::sqrt(1 - u);
    above += w.y > 0;
  }
  return static_cast<float>(above) / (kSide * kSide);
}

// G11: the distance to a sphere about the origin along a ray of unit direction, by the quadratic
// formula.
inline float SphereDistance(Vec3f o, Vec3f d, float radius) {
  const float b = 2 * Dot(o, d), c = Dot(o, o) - radius * radius;
  return (-b - std::sqrt(b * b - 4 * c)) / 2;
}

// G12: the remaining light after a missed exit from a medium, which then seems infinite.
inline float TransmittanceWithoutExit(float sigma) {
  return std::exp(-sigma * std::numeric_limits<float>::max());
}

// G13: position of a time within the shutter interval.
inline float TimeInShutter(float time, float open, float close) {
  return (time - open) / (close - open);
}

// C1: x coordinate of the point in focus along d.
inline float FocusX(Vec3f d, float distance) { return d.x * (distance / d.z); }

}  // namespace sheaf::naive
