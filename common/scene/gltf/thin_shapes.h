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
// Triangles of one point's sphere, and of one segment of a line.
inline constexpr size_t kSphereTriangles = 20, kTubeTriangles = 12;

// The diagonal of the box of the positions of the shown nodes, by the bounds that the file gives,
// in the world; 1 if that is 0. world: by node.
double SceneDiagonal(const tinygltf::Model& model, const std::vector<int>& shown,
                     const std::vector<Matrix4>& world);

// The length of the longest of the axes of a node's space, in the world; 1 if that is 0.
double LargestScale(const Matrix4& world);

// The ends of the segments of a list of vertices. mode: lines, a loop or a strip.
std::vector<std::pair<uint32_t, uint32_t>> SegmentsOf(int mode, const std::vector<uint32_t>& list);

// Puts spheres in place of the listed vertices. All else that a vertex has, its sphere has, too;
// normals are those of the spheres. radius: in the mesh's space.
void MakeSpheres(const std::vector<uint32_t>& points, float radius, Primitive* primitive);
// The same with open tubes in place of segments; those of no length are left out.
void MakeTubes(const std::vector<std::pair<uint32_t, uint32_t>>& segments, float radius,
               Primitive* primitive);

}  // namespace sheaf::gltf
