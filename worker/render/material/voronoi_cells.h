// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Cells around random points, one in each unit interval, square, cube or hypercube.
// Sources: Worley 1996, "A cellular texture basis function"; Quilez 2012 (distances to edges); the
// smooth minimum and the random points of Blender's Voronoi node.
#pragma once

#include <cstdint>

#include "common/math/vec.h"

namespace sheaf::render {

enum class VoronoiFeature : uint8_t { kF1, kF2, kSmoothF1, kDistanceToEdge };
enum class VoronoiMetric : uint8_t { kEuclidean, kManhattan, kChebychev, kMinkowski };
struct VoronoiOptions {
  VoronoiFeature feature = VoronoiFeature::kF1;
  VoronoiMetric metric = VoronoiMetric::kEuclidean;  // Distances to edges are Euclidean.
  int dimensions = 3;                                // From 1 to 4; see VoronoiPlace.
  double smoothness = 0;                             // From 0 to 1/2; for kSmoothF1.
  double exponent = 1;                               // Positive; for kMinkowski.
  double randomness = 1;  // 0: the points are the corners of the lattice.
};
struct VoronoiCell {
  double distance = 0;
  Vec3d color{};  // Random, of the point whose distance it is; 0 for kDistanceToEdge.
};
// In one dimension w alone counts, in two x and y, in three p, in four all.
struct VoronoiPlace {
  Vec3d p{};
  double w = 0;
};
// Requires: the place is finite. Thread safety: pure.
VoronoiCell VoronoiCellAt(const VoronoiOptions& options, const VoronoiPlace& place);
// The distance between the origin and the corner of a cell at `side` along each axis.
double VoronoiReach(const VoronoiOptions& options, double side);

}  // namespace sheaf::render
