// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LeakGuard: recognizes rays that must hit something. The tracer's rounding leaves a hole of a few
// ulps between the triangles about a vertex; a ray that is inside a closed mesh and misses has
// passed through one, and is traced again with a shift of a few ulps. Rays in the open are not
// retried: most of them miss rightly. See docs/adr/0006.
#pragma once

#include <cstdint>
#include <vector>

#include "common/scene/enclosed_side.h"
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

  // Call once, before rays are traced, if no probe leaves the scene.
  void NoteCameraIsEnclosed() { camera_is_enclosed_ = true; }

  // Whether the ray starts at a triangle of a closed mesh towards its inside, or the camera is in a
  // closed room. Only the tracer's rounding makes such a ray miss; if it starts outside the room it
  // may miss rightly, and the retry costs time but finds nothing either.
  bool IsEnclosed(const Ray& ray) const;

 private:
  const SceneGeometry* geometry_ = nullptr;
  std::vector<std::vector<EnclosedSide>> sides_;  // By group, by mesh.
  bool camera_is_enclosed_ = false;
};

// Camera rays in evenly distributed directions. If all hit something, the camera is in a room,
// whatever it consists of.
inline constexpr uint32_t kProbeCount = 4096;
Ray ProbeRay(uint32_t index);

// Maximum retries of an enclosed ray that missed.
inline constexpr int kNudgesMax = 4;

// The ray rotated by at most 2^-21 radians, four times as much with each further attempt (from 0),
// which is still a small fraction of a pixel. A pure function of the ray and the attempt.
Ray NudgedRay(const Ray& ray, int attempt);

}  // namespace sheaf::render
