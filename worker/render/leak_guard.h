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

#include "worker/render/ray_origin.h"
#include "worker/render/scene_geometry.h"

namespace sheaf::render {

// The side of its triangles (counter-clockwise: front) on which a mesh encloses space.
enum class EnclosedSide : uint8_t { kNone, kBack, kFront };

// A mesh encloses where it has no border: every edge is passed as often in one direction as in the
// other. Corners are told apart by their positions, so seams of indices do not matter. One pass, no
// memory; an open mesh counts as closed with probability 2^-64.
EnclosedSide EnclosedSideOf(const std::vector<Vec3f>& positions,
                            const std::vector<uint32_t>& indices);
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
