// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Vertex positions of a deforming mesh: linear between two steps, in double where the ray tracer
// interpolates in float.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "common/math/vec.h"
#include "worker/render/geometry/ray_origin.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

// Position of a time between the steps of a mesh (0: shutter open), and the fraction towards the
// later step.
struct VertexTime {
  size_t step = 0;
  double fraction = 0;
};

// shutter_fraction: in [0, 1]. Requires: the mesh deforms.
inline VertexTime VertexTimeAt(const BakedMesh& mesh, float shutter_fraction) {
  const auto last = static_cast<double>(mesh.steps.size());
  const double at = std::clamp(static_cast<double>(shutter_fraction), 0.0, 1.0) * last;
  const double step = std::min(std::floor(at), last - 1);
  return {static_cast<size_t>(step), at - step};
}
inline const std::vector<Vec3f>& PositionsOfStep(const BakedMesh& mesh, size_t step) {
  return step == 0 ? mesh.positions : mesh.steps[step - 1].positions;
}
inline const std::vector<Vec3f>& NormalsOfStep(const BakedMesh& mesh, size_t step) {
  return step == 0 ? mesh.normals : mesh.steps[step - 1].normals;
}

// A triangle of a deforming mesh (t: its three indices) at a time.
struct DeformedTriangle {
  std::array<Vec3d, 3> corners;
  Vec3f coordinate_max;  // Bound of the coordinates from which the corners were computed.
};
inline DeformedTriangle DeformedTriangleAt(const BakedMesh& mesh, const uint32_t* t,
                                           VertexTime time) {
  const std::vector<Vec3f>& before = PositionsOfStep(mesh, time.step);
  const std::vector<Vec3f>& after = PositionsOfStep(mesh, time.step + 1);
  DeformedTriangle triangle;
  for (size_t k = 0; k < 3; ++k) {
    const Vec3d p = ToDouble(before[t[k]]);
    // This form keeps a vertex that does not move exactly in place.
    triangle.corners[k] = p + (ToDouble(after[t[k]]) - p) * time.fraction;
    for (size_t i = 0; i < 3; ++i) {
      triangle.coordinate_max[i] =
          std::fmax(triangle.coordinate_max[i],
                    std::fmax(std::fabs(before[t[k]][i]), std::fabs(after[t[k]][i])));
    }
  }
  return triangle;
}
// Bound of the distance between the ray tracer's corners and these: the tracer rounds the time in a
// step and the interpolation to float.
inline double CornerErrorOf(const BakedMesh& mesh, const DeformedTriangle& triangle) {
  const Vec3f max = triangle.coordinate_max;
  return static_cast<double>(Gamma(4 + 4 * static_cast<int>(mesh.steps.size()))) *
         static_cast<double>(std::fmax(max.x, std::fmax(max.y, max.z)));
}
// Requires: the mesh has normals. Not unit length.
inline Vec3f DeformedNormalAt(const BakedMesh& mesh, uint32_t vertex, VertexTime time) {
  const Vec3f n = NormalsOfStep(mesh, time.step)[vertex];
  return n + (NormalsOfStep(mesh, time.step + 1)[vertex] - n) * static_cast<float>(time.fraction);
}

// The corners of a triangle of any mesh at a time.
inline std::array<Vec3d, 3> CornersAt(const BakedMesh& mesh, const uint32_t* t,
                                      float shutter_fraction) {
  if (!mesh.steps.empty()) {
    return DeformedTriangleAt(mesh, t, VertexTimeAt(mesh, shutter_fraction)).corners;
  }
  return {ToDouble(mesh.positions[t[0]]), ToDouble(mesh.positions[t[1]]),
          ToDouble(mesh.positions[t[2]])};
}

// Returns the position at other_time of a point of the triangle that was hit at `time`.
Vec3d CarryOver(const BakedMesh& mesh, uint32_t triangle, Vec3d p, float time, float other_time);

}  // namespace sheaf::render
