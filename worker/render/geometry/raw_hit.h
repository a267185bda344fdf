// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RawHit: where a ray meets a surface, as the ray tracer reports it.
#pragma once

#include <cstdint>

#include "worker/render/geometry/ray_origin.h"

namespace sheaf::render {

inline constexpr uint32_t kNotPlaced = ~0u;

// The tracer's record of a hit. In `id`, geometry is the mesh of the group, its QuadricsId, a
// PatchesId or a CurvesId; primitive the triangle, quadric, patch or piece of a curve; placed the
// index over `still`, then `moving`, or kNotPlaced for the world.
struct RawHit {
  float t = 0;  // In lengths of the ray's direction.
  float u = 0,
        v = 0;  // Barycentric weights of vertices 1 and 2, or a patch's or curve's parameters.
  PrimitiveId id;
  float contact = 0;  // As Ray::contact of a ray that continues from here.
};

}  // namespace sheaf::render
