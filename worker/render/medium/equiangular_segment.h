// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EquiangularSegment: a segment of a path in scattering media, along which equiangular_sampling.h
// samples light.
#pragma once

#include "common/math/vec.h"
#include "worker/render/light/equiangular.h"

namespace sheaf::render {

// Space: render.
template <typename Color>
struct EquiangularSegment {
  Vec3d o, d;                    // d: unit.
  double begin = 0, length = 0;  // Distances from o that limit the gathering.
  // Mean extinction of heterogeneous media if they alone decide whether gathering pays off; else 0.
  double extinction = 0;
  Vec3f choice_point;  // A point of the segment, for which the light is chosen.
  Color carried;       // The path's throughput at the start of the segment.
  // Valid if a gathering medium scattered the path on this segment:
  bool has_scattered = false;
  double t = 0;        // The distance of the scattering.
  double density = 0;  // As DistancePdf; in heterogeneous media MeanExtinction.
};

}  // namespace sheaf::render
