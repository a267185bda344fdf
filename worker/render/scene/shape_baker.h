// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShapeBaker: converts shapes of the description, one by one, to surfaces of a group, and the
// emissive ones to light table input.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/plan/material_traits.h"
#include "worker/render/scene/emitter_list.h"
#include "worker/render/scene/scene_baker.h"

namespace sheaf::render {

class ShapeBaker {
 public:
  // `scene` must outlive this; the last shape that uses a mesh takes its buffers.
  ShapeBaker(SceneDescription* scene, EmissionMaps maps);

  // Grows bounds by the shape's extent in the target space of `transform`. Call before AddShape.
  void GrowBounds(const ShapeDescription& shape, const Affine& transform, Bounds* bounds) const;
  // Call once for each use of the shape in the description. may_emit: whether the shape is static
  // and in the world. Errors: kInvalidArgument with the shape's location, as for BakeScene.
  absl::Status AddShape(int32_t shape_index, const Affine& target_from_shape, bool may_emit,
                        GeometryGroup* group);

  // A patch counts as two triangles.
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
  const MaterialNeedsTable needs_;
  EmitterList emitters_;
  std::vector<uint32_t> mesh_uses_;
  uint64_t degenerate_triangle_count_ = 0;
};

}  // namespace sheaf::render
