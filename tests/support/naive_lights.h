// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Common formulas of lights in single precision. docs/hard-cases.md says for each row where the
// formula breaks down; tests record their results beside the expected values (hard_case.h).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::naive {

// L1, L15: the solid angle of a sphere of radius r at distance d, by 1 - cos.
inline float SphereSolidAngle(float r, float d) {
  const float sine = r / d;
  return 2 * std::numbers::pi_v<float> * (1 - std::sqrt(1 - sine * sine));
}

// L3: the solid angle of the triangle a b c seen from the origin, by Girard's theorem.
inline float TriangleSolidAngle(Vec3f a, Vec3f b, Vec3f c) {
  const auto unit = [](Vec3f v) { return v * (1 / std::sqrt(Dot(v, v))); };
  const Vec3f ab = unit(Cross(a, b)), bc = unit(Cross(b, c)), ca = unit(Cross(c, a));
  const float angles = std::acos(-Dot(ab, bc)) + std::acos(-Dot(bc, ca)) + std::acos(-Dot(ca, ab));
  return angles - std::numbers::pi_v<float>;
}

// L4: the solid angle of a unit square seen from height h above its center, by the sum of its
// angles.
inline float SquareSolidAngle(float h) {
  const float n = 0.5f / std::sqrt(h * h + 0.25f);  // z of the normals of the planes of edges.
  return 4 * std::acos(-n * n) - 2 * std::numbers::pi_v<float>;
}

// L5: the radiance factor of a point light.
inline float InverseSquare(float distance) { return 1 / (distance * distance); }

// L7, L8, L13, L14: a part as a fraction of the whole.
inline float Fraction(float part, float whole) { return part / whole; }

// L9: relative position of a light within the bounds of the centers, for a bucket.
inline float PlaceInBounds(float x, float lower, float upper) {
  return (x - lower) / (upper - lower);
}

// L10: the last of the rounded running sums of probabilities.
inline float SumOfProbabilities(const std::vector<float>& powers) {
  float sum = 0, running = 0;
  for (const float p : powers) sum += p;
  for (const float p : powers) running += p * (1 / sum);
  return running;
}

// L30: the coefficient of variation of 1 / x^2 where x is uniform from d - r to d + r.
inline float VariationOfInverseSquares(float d, float r) {
  return std::sqrt(4 * r * r / (3 * (d * d - r * r)));
}

// L11: the light of those lights that a distribution can include: of positive power.
inline float LightOfPositive(const std::vector<float>& powers) {
  float sum = 0;
  for (const float p : powers) sum += std::max(p, 0.0f);
  return sum;
}

// L12: the importance of a cluster by its center and mean normal.
inline float CenterImportance(Vec3f center, Vec3f normal, Vec3f p, Vec3f n) {
  const Vec3f d = center - p;
  const float distance_squared = Dot(d, d);
  const float at_light = std::max(0.0f, -Dot(d, normal));
  const float at_receiver = n == Vec3f{} ? 1 : std::max(0.0f, Dot(d, n));
  return at_light * at_receiver / (distance_squared * distance_squared);
}

}  // namespace sheaf::naive
