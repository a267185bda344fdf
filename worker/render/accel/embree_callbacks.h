// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What Embree calls back while it traces: filters of triangle hits, and quadrics, patches, curves
// and placed groups as user geometry. Each sets up a geometry that has yet to be committed.
#pragma once

#include <vector>

#include "worker/render/accel/embree_door.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

// What user geometry callbacks are given.
struct QuadricList {
  const std::vector<BakedQuadric>* quadrics = nullptr;
  uint32_t geometry = 0;
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
  uint32_t first = 0;  // Index of the list's first in RawHit::placed.
  const std::vector<RTCScene>* scenes = nullptr;
};

// Keeps rays from meeting the triangle they leave, and says where they meet others. Where the mesh
// has needles, hits are tested again in double. `mesh` must outlive the geometry.
void FilterTriangles(RTCGeometry triangles, const BakedMesh& mesh, bool has_needles);
// The same for a mesh that deforms, whose triangles may be needles at any time.
void FilterDeforming(RTCGeometry triangles, const BakedMesh& mesh);

// Sets u and v of the hit that the trace ended with.
void Settle(const TraceContext& context, RTCRayHit* ray_hit);

// `list` must outlive the geometry.
void SetQuadrics(RTCGeometry user, QuadricList* list);
void SetPatches(RTCGeometry user, PatchList* list);
void SetCurves(RTCGeometry user, CurveList* list);
void SetPlaced(RTCGeometry user, PlacedList* list);

}  // namespace sheaf::render
