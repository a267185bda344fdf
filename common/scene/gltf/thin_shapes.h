// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Points and lines of glTF as surfaces: spheres and tubes, as thin as a line of a few pixels where
// the whole scene is in view.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <cstdint>
#include <utility>
#include <vector>

#include "common/math/transform.h"
#include "common/scene/gltf/meshes.h"

namespace sheaf::gltf {

// Radii of points and of lines, in diagonals of the box of all that is shown.
inline constexpr double kPointRadius = 1.0 / 500, kLineRadius = 1.0 / 1000;
// The points of a primitive that are icosahedra, and the segments with six sides, at most; where
// there are more, all are octahedra, and have three sides.
inline constexpr size_t kRoundMax = 4096;
// Between the vertices of a strip or a loop, which starts again behind it.
inline constexpr uint32_t kRestart = 0xffffffff;

// The triangles and vertices that this many points or segments become.
struct ThinCost {
  uint64_t triangles, vertices;
};
inline ThinCost CostOfPoints(uint64_t points) {
  return points <= kRoundMax ? ThinCost{20 * points, 12 * points}
                             : ThinCost{8 * points, 6 * points};
}
inline ThinCost CostOfSegments(uint64_t segments) {
  const uint64_t sides = segments <= kRoundMax ? 6 : 3;
  return {2 * sides * segments, 2 * sides * segments};
}

// The diagonal of the box of the positions of the shown nodes, by the bounds that the file gives,
// in the world; 0 without bounds. world: by node.
double SceneDiagonal(const tinygltf::Model& model, const std::vector<int>& shown,
                     const std::vector<Matrix4>& world);

// The diagonal of the box of the points; 1 if that is 0.
double DiagonalOf(const std::vector<Vec3f>& points);

// The length of the longest of the axes of a node's space, in the world; 1 if that is 0.
double LargestScale(const Matrix4& world);

// The ends of the segments of a list of vertices, or of several, separated by kRestart. mode:
// lines, a loop or a strip.
std::vector<std::pair<uint32_t, uint32_t>> SegmentsOf(int mode, const std::vector<uint32_t>& list);

// Puts spheres in place of the listed vertices. All else that a vertex has, its sphere has, too;
// normals are those of the spheres. radius: in the mesh's space.
void MakeSpheres(const std::vector<uint32_t>& points, float radius, Primitive* primitive);
// The same with open tubes in place of segments; those of no length are left out.
void MakeTubes(const std::vector<std::pair<uint32_t, uint32_t>>& segments, float radius,
               Primitive* primitive);

}  // namespace sheaf::gltf
