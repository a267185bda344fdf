// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Ray, and safe ray origins. A point computed in float has a bounded error; a ray that leaves a
// surface starts beyond that bound, on the side it leaves to, so that it cannot hit that surface
// again. The bounds are relative to the coordinates, independent of the scene's scale. Source:
// pbrt-v4, sec. 6.8; Higham 2002, "Accuracy and Stability of Numerical Algorithms", ch. 3.
#pragma once

#include <cmath>
#include <compare>
#include <cstdint>
#include <limits>

#include "common/math/lanes.h"
#include "common/math/next_float.h"
#include "common/math/vec.h"
#include "worker/render/geometry/seen_by.h"

namespace sheaf::render {

// Upper bound of the relative error of n roundings in float.
constexpr float Gamma(int n) {
  constexpr float kHalfUlp = std::numeric_limits<float>::epsilon() * 0.5f;
  return static_cast<float>(n) * kHalfUlp / (1 - static_cast<float>(n) * kHalfUlp);
}

// Identifies a primitive of the scene: a triangle of a mesh, a quadric, a patch or a piece of a
// curve, in the world or a placed group.
struct PrimitiveId {
  uint32_t geometry = ~0u, primitive = ~0u, placed = ~0u;
  friend constexpr auto operator<=>(const PrimitiveId&, const PrimitiveId&) = default;
};

// Space: render. d need not be unit; t counts in lengths of d, from 0 to t_max (both exclusive).
struct Ray {
  Vec3f o, d;
  float t_max = std::numeric_limits<float>::infinity();
  float time = 0;  // Fraction of the shutter interval, in [0, 1].
  // The primitive that the ray leaves. A flat triangle cannot be hit again, so it is skipped: the
  // tracer's own rounding on a needle may exceed any useful offset.
  PrimitiveId source;
  // Positive if other surfaces may lie where the ray leaves `source` (contact.h): the ray begins
  // this far before that place, along its normal, and meets those that come after `source`.
  float contact = 0;
  float lead = 0;  // Then the distance along d from its beginning to that place, in render space.
  // Curves: the shape that the ray leaves is hit as if the ray began this far off, at a place that
  // is beyond every ribbon about the center line.
  Vec3f own_offset{};
  // Where a bounded ray ends.
  enum class End : uint8_t {
    kExact,   // At t_max.
    kFree,    // At a point that surfaces at its place do not hide: a point light, a lens.
    kEmitter  // On `end_emitter` of the light table, behind the surfaces that come before it.
  };
  End end = End::kExact;
  RayMask mask = kEverything;  // The surfaces that it meets.
  uint32_t end_emitter = ~0u;
};

inline Vec3f Abs(Vec3f v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }

// Origin for a ray that leaves the surface point p (known to p_error, per component) towards w.
// n: unit geometric normal, of either side.
inline Vec3f OffsetRayOrigin(Vec3f p, Vec3f p_error, Vec3f n, Vec3f w) {
  const float distance = Dot(Abs(n), p_error);
  const Floats4 offset = Floats4{n.x, n.y, n.z, 0} * (Dot(w, n) < 0 ? -distance : distance);
  // The sum itself rounds: away from p, never towards it.
  const Floats4 origin = NextTowards(Floats4{p.x, p.y, p.z, 0} + offset, offset);
  return {origin[0], origin[1], origin[2]};
}

}  // namespace sheaf::render
