// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A segment of a path through media that scatter, as path_tracer_lines.h gathers light along it.
#pragma once

#include "common/math/vec.h"
#include "worker/render/light/equiangular.h"

namespace sheaf::render {

// Space: render.
template <typename Color>
struct MediumLine {
  Vec3d o, d;                    // d: unit.
  double begin = 0, length = 0;  // Distances from o: light is gathered in between.
  // Of media that vary, the mean, where they alone decide whether gathering pays; else 0.
  double extinction = 0;
  Vec3f where_chosen;  // A point of it, at which its light is chosen.
  Color carried;       // The path's throughput where it begins.
  // Set where a medium that gathers light scattered the path on it:
  bool has_scattered = false;
  double t = 0;        // At this distance.
  double density = 0;  // As FlightDensity; in media that vary, MeanExtinction.
};

}  // namespace sheaf::render
