// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShapeBaker: shapes of the description as surfaces of a group, one after the other, and the
// emissive ones as light table input.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/scene/emitter_list.h"
#include "worker/render/scene/scene_baker.h"

namespace sheaf::render {

class ShapeBaker {
 public:
  // `scene` must outlive this; its mesh buffers are taken by the last shape that uses them.
  ShapeBaker(SceneDescription* scene, EmissionMaps maps);

  // Adds where the shape reaches in the space that `transform` leads to. Call before AddShape.
  void GrowBounds(const ShapeDescription& shape, const Affine& transform, Bounds* bounds) const;
  // Call once for each use that the description makes of the shape. may_emit: it is at rest, in the
  // world. Errors: kInvalidArgument with the shape's location, as BakeScene.
  absl::Status AddShape(int32_t shape_index, const Affine& target_from_shape, bool may_emit,
                        GeometryGroup* group);

  // A patch counts as two.
  uint64_t degenerate_triangle_count() const { return degenerate_triangle_count_; }
  // Call once, after all shapes.
  LightTableInput TakeEmitters(GeometryGroup* world);

 private:
  absl::Status Fail(const ShapeDescription& shape, const std::string& what) const;
  TriangleMesh TakeMesh(int32_t mesh);
  Surface MakeSurface(int32_t shape_index) const;
  absl::Status AddMesh(const ShapeDescription& shape, Surface surface, TriangleMesh mesh,
                       const Affine& target_from_shape, GeometryGroup* group);
  absl::Status AddPatches(const ShapeDescription& shape, Surface surface,
                          const Affine& target_from_shape, GeometryGroup* group);
  absl::Status AddCurves(const ShapeDescription& shape, Surface surface,
                         const Affine& target_from_shape, GeometryGroup* group);
  absl::Status AddQuadric(const ShapeDescription& shape, Surface surface, Quadric quadric,
                          const Affine& target_from_shape, GeometryGroup* group);

  SceneDescription& scene_;
  EmitterList emitters_;
  std::vector<uint32_t> mesh_uses_;
  uint64_t degenerate_triangle_count_ = 0;
};

}  // namespace sheaf::render
