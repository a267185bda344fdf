// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LeakGuard: knows of rays that cannot truly meet nothing. Between the triangles about a vertex the
// tracer's rounding leaves a hole of some ulps; a ray that is inside a closed mesh and finds
// nothing has gone through one and is worth tracing again, a few ulps aside. Rays in the open are
// not: most of them meet nothing because nothing is there. See docs/adr/0006.
#pragma once

#include <cstdint>
#include <vector>

#include "common/scene/enclosed_side.h"
#include "worker/render/geometry/ray_origin.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

// Of a mesh that may deform: the side that it encloses at every step.
EnclosedSide EnclosedSideOf(const BakedMesh& mesh);

class LeakGuard {
 public:
  LeakGuard() = default;
  // `geometry` must outlive the guard.
  explicit LeakGuard(const SceneGeometry& geometry);

  // Told once, before rays are traced: no probe leaves the scene.
  void NoteCameraIsEnclosed() { camera_is_enclosed_ = true; }

  // Whether the ray leaves a triangle of a closed mesh to its inside, or the camera is in a closed
  // room. Such a ray meets something but for the tracer's rounding; outside the room it may not,
  // and looking again costs time but finds nothing either.
  bool IsEnclosed(const Ray& ray) const;

 private:
  const SceneGeometry* geometry_ = nullptr;
  std::vector<std::vector<EnclosedSide>> sides_;  // By group, by mesh.
  bool camera_is_enclosed_ = false;
};

// Rays from the camera, even in all directions. Where every one meets something the camera is in a
// room, whatever that is put together from.
inline constexpr uint32_t kProbeCount = 4096;
Ray ProbeRay(uint32_t index);

// How often an enclosed ray that met nothing is traced again.
inline constexpr int kNudgesMax = 4;

// The ray turned by 2^-21 radians at most, four times as much with each further attempt (from 0; a
// small part of any pixel still). A pure function of the ray and the attempt.
Ray NudgedRay(const Ray& ray, int attempt);

}  // namespace sheaf::render
