// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneGeometry: the scene's surfaces as the ray tracer and the hits see them. What is placed in
// the world directly is baked into render space: world axes, origin at the camera when the shutter
// opens, so that coordinates are small where they are seen. Object definitions are baked about the
// centre of their own bounds and placed by transforms of double.
#pragma once

#include <cstdint>
#include <vector>

#include "common/scene/scene_description.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/geometry/animated_transform.h"
#include "worker/render/geometry/bilinear_patch.h"
#include "worker/render/geometry/curve.h"
#include "worker/render/geometry/quadric.h"

namespace sheaf::render {

inline constexpr uint32_t kNoEmitter = ~0u;
// The rank of surfaces that bound no interior with a priority, and of no interior.
inline constexpr uint16_t kNoRank = 0xffff;

// What all points of one shape have in common.
struct Surface {
  int32_t material = kNone;
  int32_t shape = kNone;          // Index in SceneDescription::shapes.
  uint32_t emitter = kNoEmitter;  // Id of the shape's first primitive in the light table.
  bool flips_normal = false;      // reverse_orientation, and for triangles a mirroring transform.
  bool has_alpha = false;
  bool may_pass = false;  // The material is an interface, or a mix (which may turn into one).
  bool is_sphere = false;
  bool needs_tangent = false;    // Scatters differently along u and v.
  bool reads_textures = false;   // The material, the cut-out or the emission reads a texture.
  bool has_normal_map = false;   // Or a bump map.
  uint16_t rank = kNoRank;       // Of the matter inside, where it has a priority: InteriorTable.
  bool encloses_matter = false;  // The inside of the material begins here.
  bool paints_matter = false;    // And is what a texture says there.
  MediumBoundary media;
  // Each triangle that emits a picture is so many emitters squared: emission_cells.h.
  uint16_t emission_cells = 1;
};
struct BakedMesh {
  Surface surface;
  std::vector<Vec3f> positions;   // One more than used: the ray tracer reads 16 bytes a vertex.
  std::vector<Vec3f> normals;     // Unit length, or empty.
  std::vector<Vec2f> uvs;         // Or empty.
  std::vector<uint32_t> indices;  // Three per triangle; degenerate triangles are gone.
  // Of a mesh that deforms (deforming_mesh.h): the vertices later, at even steps until the shutter
  // closes, like those above.
  std::vector<VertexStep> steps;
};
// The side of a triangle its shape faces: 1 along cross = Cross(p1 - p0, p2 - p0), -1 against it.
// Vertex normals decide where there are any (as in pbrt-v4), else the shape's orientation.
inline float FacingOf(const Surface& surface, Vec3d cross, Vec3f sum_of_normals) {
  const double side = Dot(cross, ToDouble(sum_of_normals));
  if (side != 0) return side < 0 ? -1.0f : 1.0f;
  return surface.flips_normal ? -1.0f : 1.0f;
}
// t: its three indices.
inline float TriangleFacing(const BakedMesh& mesh, const uint32_t* t, Vec3d cross) {
  if (!mesh.normals.empty()) {
    return FacingOf(mesh.surface, cross,
                    mesh.normals[t[0]] + mesh.normals[t[1]] + mesh.normals[t[2]]);
  }
  return mesh.surface.flips_normal ? -1.0f : 1.0f;
}
struct BakedQuadric {
  Surface surface;
  Quadric quadric;
};
// Bilinear patches of one shape. Their corners are rounded to float like vertices, so that what
// shares corners in the file shares them here.
struct BakedPatches {
  Surface surface;
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;     // Unit length, or empty.
  std::vector<Vec2f> uvs;         // Or empty: u and v themselves.
  std::vector<uint32_t> indices;  // Four per patch; patches without area are gone.

  size_t size() const { return indices.size() / 4; }
  BilinearPatch PatchAt(size_t i) const {
    const uint32_t* k = &indices[4 * i];
    return {ToDouble(positions[k[0]]), ToDouble(positions[k[1]]), ToDouble(positions[k[2]]),
            ToDouble(positions[k[3]])};
  }
};
// Curves of one shape, in the shape's own space as the file has them: it decides which way is
// across, and their widths may be too thin for another rounding.
struct BakedCurves {
  Surface surface;
  CurveSet set;
  std::vector<CurvePiece> pieces;  // Segments without length or width are gone.
  std::vector<CurveRod> rods;      // About each piece.
  Affine target_from_shape, shape_from_target;
  Vec3f coordinate_max;  // Of the numbers that points are computed from, in the target.

  size_t size() const { return pieces.size(); }
};
// What is traced as one acceleration structure: the world, or one object definition.
struct GeometryGroup {
  std::vector<BakedMesh> meshes;
  std::vector<BakedQuadric> quadrics;
  std::vector<BakedPatches> patches;
  std::vector<BakedCurves> curves;
  Vec3d center;  // Of its own space, in the space of the shapes' transforms.
  Vec3f bounds_lower, bounds_upper;
  double radius = 0;  // Of the ball about `center` that holds everything.

  bool empty() const {
    return meshes.empty() && quadrics.empty() && patches.empty() && curves.empty();
  }
  // PrimitiveId::geometry of hits: the index of a mesh; then all quadrics; then each of `patches`,
  // then each of `curves`.
  uint32_t QuadricsId() const { return static_cast<uint32_t>(meshes.size()); }
  uint32_t PatchesId(size_t index) const {
    return static_cast<uint32_t>(meshes.size() + 1 + index);
  }
  uint32_t CurvesId(size_t index) const { return PatchesId(patches.size() + index); }
};
struct PlacedGroup {
  uint32_t group = 0;
  Affine render_from_group, group_from_render;  // At shutter opening where it moves.
  int32_t motion = kNone;                       // Index in SceneGeometry::motions.
  int32_t instance = kNone;  // Index in SceneDescription::instances; none for a shape that moves.
};
struct GroupMotion {
  AnimatedTransform world_from_placed;
  Vec3d group_center, render_origin_world;
  Affine RenderFromGroup(double time) const {
    Affine transform = world_from_placed.At(time);
    transform.offset = transform.Point(group_center) - render_origin_world;
    return transform;
  }
};
struct SceneGeometry {
  std::vector<GeometryGroup> groups;  // groups[0] is the world, in render space.
  std::vector<PlacedGroup> still;     // Placed without motion.
  std::vector<PlacedGroup> moving;
  std::vector<GroupMotion> motions;
  Vec3d render_origin_world;
  double shutter_open = 0, shutter_close = 0;
  uint64_t degenerate_triangle_count = 0;
  Vec3f bounds_lower, bounds_upper;  // Of everything over the shutter, render space.
};

// Where a placed group is when the ray is, at a fraction of the shutter interval.
inline Affine RenderFromGroupAt(const SceneGeometry& geometry, const PlacedGroup& placed,
                                float shutter_fraction) {
  if (placed.motion == kNone) return placed.render_from_group;
  const double open = geometry.shutter_open;
  return geometry.motions[placed.motion].RenderFromGroup(
      open + (geometry.shutter_close - open) * static_cast<double>(shutter_fraction));
}
inline Affine GroupFromRenderAt(const SceneGeometry& geometry, const PlacedGroup& placed,
                                float shutter_fraction) {
  if (placed.motion == kNone) return placed.group_from_render;
  return Inverse(RenderFromGroupAt(geometry, placed, shutter_fraction));
}

struct PlacedBounds {
  Vec3f lower, upper;
};
// Bounds in render space, rounded outwards.
PlacedBounds BoundsOfStill(const SceneGeometry& geometry, const PlacedGroup& placed);
// Boxes at kMotionStepCount even steps over the shutter (step from 0): moved linearly between two
// steps they hold the group at every time between.
inline constexpr uint32_t kMotionStepCount = 17;
PlacedBounds BoundsOfMoving(const SceneGeometry& geometry, const PlacedGroup& placed,
                            uint32_t step);

}  // namespace sheaf::render
