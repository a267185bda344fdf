// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Loop subdivision surfaces (pbrt's loopsubdiv), refined a number of times and moved to the limit
// surface. Source: Loop 1987; boundary rules and limit masks of Hoppe et al. 1994; Warren's beta;
// pbrt-v4.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Returns the refined mesh with positions and normals on the limit surface, in the orientation pbrt
// gives them. Each triangle of the control mesh becomes 4^levels triangles.
// Requires: indices are below positions.size() and three per triangle; levels >= 0.
// Errors: kInvalidArgument if an edge belongs to more than two triangles, two neighbors wind
// differently, or triangles touch only in a vertex; kResourceExhausted beyond triangles_max.
absl::StatusOr<TriangleMesh> SubdivideLoop(const std::vector<Vec3f>& positions,
                                           const std::vector<uint32_t>& indices, int32_t levels,
                                           uint64_t triangles_max);

}  // namespace sheaf
