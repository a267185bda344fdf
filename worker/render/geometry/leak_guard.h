// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LeakGuard: finds rays that the tracer's rounding lets pass between triangles. Its edge tests
// agree on shared edges, but at a vertex those of all triangles about it may reject a ray: a hole
// of a few ulps. A ray that hits nothing is traced again, turned to several sides by more than the
// hole is wide. It leaks if there is a surface on every side and if, in double, it passes within
// the tracer's rounding of one of the triangles there. Along the edge of a slit, one of the sides
// is open. See docs/adr/0006.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "common/scene/enclosed_side.h"
#include "worker/render/geometry/raw_hit.h"
#include "worker/render/geometry/ray_origin.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

// The side that the mesh encloses at every step, if it deforms.
EnclosedSide EnclosedSideOf(const BakedMesh& mesh);

class LeakGuard {
 public:
  LeakGuard() = default;
  // `geometry` must outlive the guard.
  explicit LeakGuard(const SceneGeometry& geometry);

  // Call once, before rays are traced, if no light comes from outside the scene: then rays that
  // leave it bring nothing, and need a test only inside closed meshes, whose media they must leave.
  void NoteOutsideIsDark() { outside_is_dark_ = true; }

  // Whether the ray may have left a room by rounding. Those that start at a closed mesh towards its
  // outside most often leave the scene rightly.
  bool MayLeak(const Ray& ray) const;

  // hit: that of a nudged ray. Whether it is also one of the ray itself: at an edge or vertex of
  // the triangle, which the ray passes within rounding. Then sets *hit to the nearest point there.
  bool TouchesAtEdge(const Ray& ray, RawHit* hit) const;

 private:
  const SceneGeometry* geometry_ = nullptr;
  std::vector<std::vector<EnclosedSide>> sides_;  // By group, by mesh.
  bool outside_is_dark_ = false;
};

inline constexpr int kWideNudgeCount = 4, kNudgeCount = 8;
// A nudged ray may pass through the same hole, which is larger where triangles are seen edge-on:
// then it is turned farther, at most so often.
inline constexpr int kWideningsMax = 2;

// The ray turned by 2^-19 radians and moved by as much of its coordinates, to four sides, by more
// than most holes are wide; then by 2^-21, to find the smaller triangles about the ray. Each
// widening doubles that. A pure function of its arguments.
Ray NudgedRay(const Ray& ray, int attempt, int widening = 0);

// The largest coordinate of the ray's origin, with which the tracer's rounding grows.
inline float ReachOfOrigin(const Ray& ray) {
  const Vec3f o = render::Abs(ray.o);
  return std::max(o.x, std::max(o.y, o.z));
}

// The ray turned by `turn_radians`, and moved by as much of its coordinates, away from the triangle
// of `hit`, across the edge that the ray passes outside of. Requires: the hit is one of a mesh.
Ray BesideEdge(const SceneGeometry& geometry, const Ray& ray, const RawHit& hit,
               float turn_radians);

}  // namespace sheaf::render
