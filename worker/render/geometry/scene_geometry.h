// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneGeometry: the scene's surfaces in the form that the ray tracer and shading use. Shapes
// placed directly in the world are baked into render space: world axes, origin at the camera at
// shutter open, so that visible coordinates are small; or in the middle of the scene, if the camera
// is far away from it. Object definitions are baked about the
// center of their own bounds and placed by transforms of double.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/scene/scene_description.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/geometry/animated_transform.h"
#include "worker/render/geometry/bilinear_patch.h"
#include "worker/render/geometry/curve.h"
#include "worker/render/geometry/quadric.h"
#include "worker/render/geometry/ray_origin.h"

namespace sheaf::render {

inline constexpr uint32_t kNoEmitter = ~0u;
// Rank of a surface whose interior has no priority, and of empty space.
inline constexpr uint16_t kNoRank = 0xffff;

// The largest coordinate of what rays meet, in render space and in that of its group. Embree drops
// what is beyond 1.8e18 and asserts that no ray is.
inline constexpr float kTracedMax = 1e18f;
inline bool IsTraced(Vec3f p) {
  return std::fabs(p.x) <= kTracedMax && std::fabs(p.y) <= kTracedMax &&
         std::fabs(p.z) <= kTracedMax;
}

// Properties common to all points of one shape.
struct Surface {
  int32_t material = kNone;
  int32_t shape = kNone;          // Index in SceneDescription::shapes.
  uint32_t emitter = kNoEmitter;  // Id of the shape's first primitive in the light table.
  bool flips_normal = false;      // reverse_orientation, and for triangles a mirroring transform.
  bool has_alpha = false;
  bool may_pass = false;  // The material is an interface, or a mix (which may resolve to one).
  bool is_sphere = false;
  bool needs_tangent = false;           // The BSDF depends on the tangent.
  bool reads_textures = false;          // The material, the cut-out or the emission uses a texture.
  bool has_normal_map = false;          // Or a bump map.
  uint16_t rank = kNoRank;              // The interior's rank, if it has a priority: InteriorTable.
  bool encloses_subsurface = false;     // A boundary of a subsurface medium.
  bool has_subsurface_texture = false;  // A texture scales the scattering of that medium here.
  // The surface bounds a body: light passes into glass or a medium behind it.
  bool is_boundary = false;
  bool emits_on_front_only = false;
  RayKinds invisible = 0;         // As ShapeDescription::invisible.
  RayMask seen_by = kEverything;  // The rays that meet it.
  MediumBoundary media;
  // A triangle with an emission image has emission_cells^2 emitters: emission_cells.h.
  uint16_t emission_cells = 1;
  float area = 0;  // The area of the whole shape, approximately, in the space of its group.
};
struct BakedMesh {
  Surface surface;
  std::vector<Vec3f> positions;     // Plus one: the ray tracer reads 16 bytes per vertex.
  std::vector<Vec3f> normals;       // Unit length, or empty.
  std::vector<Vec2f> uvs;           // Or empty.
  std::vector<Vec3f> tangents;      // Any length, or empty; used only if surface.needs_tangent.
  std::vector<VertexColor> colors;  // Or empty; used only if surface.reads_textures.
  std::vector<uint32_t> indices;    // Three per triangle, without degenerate ones.
  // Vertices of a deforming mesh (deforming_mesh.h) at later, equidistant steps until shutter
  // close, in the same form.
  std::vector<VertexStep> steps;
  Affine target_from_shape, shape_from_target;  // From the file's vertices.
};
// Bound of a vertex's coordinates as the file's rounding sees them: those in the file, turned and
// scaled into the target but not moved. p: the vertex in the target.
inline Vec3d FileReach(const Affine& target_from_shape, const Affine& shape_from_target, Vec3d p) {
  const Vec3d q = shape_from_target.Point(p);
  Vec3d reach;
  for (size_t i = 0; i < 3; ++i) {
    reach[i] = std::fabs(target_from_shape.x[i] * q.x) + std::fabs(target_from_shape.y[i] * q.y) +
               std::fabs(target_from_shape.z[i] * q.z);
  }
  return reach;
}
// The side of a triangle that its shape faces: 1 along cross = Cross(p1 - p0, p2 - p0), -1 against
// it. Vertex normals decide if present (as in pbrt-v4), else the shape's orientation.
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
// Bilinear patches of one shape. Corners are rounded to float like vertices, so that corners shared
// in the file stay shared.
struct BakedPatches {
  Surface surface;
  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;                   // Unit length, or empty.
  std::vector<Vec2f> uvs;                       // Empty: u and v themselves.
  std::vector<uint32_t> indices;                // Four per patch, without patches of zero area.
  Affine target_from_shape, shape_from_target;  // From the file's vertices.

  size_t size() const { return indices.size() / 4; }
  BilinearPatch PatchAt(size_t i) const {
    const uint32_t* k = &indices[4 * i];
    return {ToDouble(positions[k[0]]), ToDouble(positions[k[1]]), ToDouble(positions[k[2]]),
            ToDouble(positions[k[3]])};
  }
};
// Curves of one shape, in the shape's own space as in the file: that space decides which direction
// is across, and widths may be too thin for another rounding.
struct BakedCurves {
  Surface surface;
  CurveSet set;
  std::vector<CurvePiece> pieces;  // Without segments of zero length or width.
  std::vector<CurveRod> rods;      // About each piece.
  Affine target_from_shape, shape_from_target;
  Vec3f coordinate_max;  // Bound of the coordinates from which points are computed, in the target.

  size_t size() const { return pieces.size(); }
};
// The contents of one acceleration structure: the world, or one object definition.
struct GeometryGroup {
  std::vector<BakedMesh> meshes;
  std::vector<BakedQuadric> quadrics;
  std::vector<BakedPatches> patches;
  std::vector<BakedCurves> curves;
  Vec3d center;  // Origin of the group's space, in the space of the shapes' transforms.
  Vec3f bounds_lower, bounds_upper;
  double radius = 0;  // Radius of a ball about `center` that contains everything.

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
  Affine render_from_group, group_from_render;  // At shutter open if moving.
  int32_t motion = kNone;                       // Index in SceneGeometry::motions.
  int32_t instance = kNone;  // Index in SceneDescription::instances; none for a moving shape.
};
struct GroupMotion {
  AnimatedTransform world_from_placed;
  Vec3d group_center, render_origin_world;
  // The motion of a shape within its object.
  std::optional<AnimatedTransform> placed_from_shape = std::nullopt;
  // Upper bound of the distance between the path of any point of the group, which lies within
  // `radius` of its center, and the straight line between its positions at the two times.
  double LinearDeviationMax(double time_0, double time_1, double radius) const;
  Affine RenderFromGroup(double time) const {
    Affine transform = world_from_placed.At(time);
    if (placed_from_shape.has_value()) transform = transform * placed_from_shape->At(time);
    transform.offset = transform.Point(group_center) - render_origin_world;
    return transform;
  }
};
// The emitters of one shape of the world: from `first` on, one or emission_cells^2 a primitive.
struct EmitterRange {
  uint32_t first = 0;
  uint32_t geometry = 0, primitive = 0;  // Those of PrimitiveId, for `first`.
  uint32_t per_primitive = 1, count = 0;
};
struct SceneGeometry {
  std::vector<GeometryGroup> groups;  // groups[0] is the world, in render space.
  std::vector<PlacedGroup> still;     // Placed without motion.
  std::vector<PlacedGroup> moving;
  std::vector<GroupMotion> motions;
  Vec3d render_origin_world;
  // Not 0: the camera is so far away that the origin is the middle of the scene instead, and this
  // is the radius of a ball about it that contains everything.
  double radius_if_far = 0;
  double shutter_open = 0, shutter_close = 0;
  uint64_t degenerate_triangle_count = 0;
  Vec3f bounds_lower, bounds_upper;  // Over the whole shutter interval, in render space.
  Vec3f reach;  // Bound of the coordinates of the world's vertices, here and in the file.
  std::vector<EmitterRange> emitters;  // By `first`.
};

// placed: PrimitiveId::placed of a hit in a placed group.
inline const PlacedGroup& PlacedAt(const SceneGeometry& geometry, uint32_t placed) {
  const size_t still_count = geometry.still.size();
  return placed < still_count ? geometry.still[placed] : geometry.moving[placed - still_count];
}

// The transform of a placed group at a fraction of the shutter interval.
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
// Fills geometry->emitters, once the ids of all emitters are final.
void IndexEmitters(SceneGeometry* geometry);
// The primitive that is or has the emitter of the light table; none for lights without a surface.
std::optional<PrimitiveId> PrimitiveOfEmitter(const SceneGeometry& geometry, uint32_t emitter);

// Bounds in render space, rounded outwards.
PlacedBounds BoundsOfStill(const SceneGeometry& geometry, const PlacedGroup& placed);
// Boxes at kMotionStepCount equidistant steps over the shutter interval (step from 0): interpolated
// linearly between steps, they contain the group at all times.
inline constexpr uint32_t kMotionStepCount = 17;
PlacedBounds BoundsOfMoving(const SceneGeometry& geometry, const PlacedGroup& placed,
                            uint32_t step);

}  // namespace sheaf::render
