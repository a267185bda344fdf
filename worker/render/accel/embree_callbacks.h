// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Embree callbacks: filters of triangle hits, and quadrics, patches, curves and placed groups as
// user geometry. Each function sets up a geometry that the caller then commits.
#pragma once

#include <vector>

#include "worker/render/accel/embree_door.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

// The user data of the callbacks.
struct TracedMesh {
  const BakedMesh* mesh = nullptr;
  Vec3f reach;  // Bound of the coordinates in its group, plus FileReach.
};
struct QuadricList {
  const std::vector<BakedQuadric>* quadrics = nullptr;
  uint32_t geometry = 0;
  bool have_masks = false;  // Some rays do not meet all of them.
};
struct PatchList {
  const BakedPatches* patches = nullptr;
  uint32_t geometry = 0;
};
struct CurveList {
  const BakedCurves* curves = nullptr;
  uint32_t geometry = 0;
};
struct PlacedList {
  const SceneGeometry* geometry = nullptr;
  const std::vector<PlacedGroup>* placed = nullptr;
  uint32_t first = 0;  // Index in RawHit::placed of the list's first group.
  const std::vector<RTCScene>* scenes = nullptr;
};

// Makes rays skip the triangle they leave, and computes hit distances. If the mesh has needles,
// hits are tested again in double. `mesh` must outlive the geometry.
void FilterTriangles(RTCGeometry triangles, TracedMesh* mesh, bool has_needles);
// The same for a deforming mesh, whose triangles may be needles at any time.
void FilterDeforming(RTCGeometry triangles, TracedMesh* mesh);

// Computes u and v of the final hit, and whether the ray passes beside its triangle.
void Settle(const TraceContext& context, RTCRayHit* ray_hit);

// `list` must outlive the geometry.
void SetQuadrics(RTCGeometry user, QuadricList* list);
void SetPatches(RTCGeometry user, PatchList* list);
void SetCurves(RTCGeometry user, CurveList* list);
void SetPlaced(RTCGeometry user, PlacedList* list);

}  // namespace sheaf::render
