// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/geometry/deforming_mesh.h"

namespace sheaf::render {

Vec3d CarryOver(const BakedMesh& mesh, uint32_t triangle, Vec3d p, float time, float other_time) {
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(triangle)];
  const std::array<Vec3d, 3> now = CornersAt(mesh, t, time), then = CornersAt(mesh, t, other_time);
  const Vec3d e1 = now[1] - now[0], e2 = now[2] - now[0], w = p - now[0];
  const Vec3d n = Cross(e1, e2);
  const double square = LengthSquared(n);
  if (!(square > 0)) return then[0];
  const double u = Dot(Cross(w, e2), n) / square, v = Dot(Cross(e1, w), n) / square;
  return then[0] + (then[1] - then[0]) * u + (then[2] - then[0]) * v;
}

}  // namespace sheaf::render
