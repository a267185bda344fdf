// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription > SceneGeometry: transforms in double, one rounding to float at the end.
#include "worker/render/scene_geometry.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "worker/render/bounds.h"
#include "worker/render/emitter_list.h"
#include "worker/render/material_traits.h"

namespace sheaf::render {
namespace {

bool IsFinite(Vec3f v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

class SceneBaker {
 public:
  explicit SceneBaker(SceneDescription* scene) : scene_(*scene) {}

  absl::StatusOr<BakedScene> Bake();

 private:
  absl::Status Fail(SourceLocation location, const std::string& what) const {
    return absl::InvalidArgumentError(absl::StrCat(FormatLocation(scene_, location), ": ", what));
  }
  bool Moves(const TransformOverTime& t) const {
    return t.IsAnimated() && geometry_.shutter_close > geometry_.shutter_open;
  }
  void CountMeshUses();
  absl::Status BakeObjects();
  absl::Status BakeInstances();
  absl::Status BakeWorldShapes();
  // The transform of what stands still while the shutter is open.
  absl::StatusOr<Affine> StillTransform(const TransformOverTime& t, SourceLocation location) const;
  absl::StatusOr<int32_t> AddMotion(const TransformOverTime& t, Vec3d group_center,
                                    SourceLocation location);
  absl::Status AddShape(int32_t shape_index, const Affine& target_from_shape, bool may_emit,
                        GeometryGroup* group);
  absl::Status AddMesh(const ShapeDescription& shape, Surface surface,
                       const Affine& target_from_shape, bool may_emit, GeometryGroup* group);
  absl::Status AddQuadric(const ShapeDescription& shape, Surface surface,
                          const Affine& target_from_shape, bool may_emit, GeometryGroup* group);
  Surface MakeSurface(int32_t shape_index) const;
  // Adds where the shape reaches in the space of its transform.
  void GrowBounds(const ShapeDescription& shape, const Affine& transform, Bounds* bounds) const;
  TriangleMesh TakeMesh(int32_t mesh);
  static void FinishGroup(GeometryGroup* group);
  void FinishSceneBounds();

  SceneDescription& scene_;
  SceneGeometry geometry_;
  EmitterList emitters_;
  std::vector<uint32_t> mesh_uses_;
};

void SceneBaker::CountMeshUses() {
  mesh_uses_.assign(scene_.meshes.size(), 0);
  const auto count = [this](int32_t shape) {
    const auto* mesh = std::get_if<MeshShape>(&scene_.shapes[shape].shape);
    if (mesh != nullptr) ++mesh_uses_[mesh->mesh];
  };
  for (const int32_t shape : scene_.world_shapes) count(shape);
  for (const ObjectDefinition& object : scene_.objects) {
    for (const int32_t shape : object.shapes) count(shape);
  }
}

TriangleMesh SceneBaker::TakeMesh(int32_t mesh) {
  if (--mesh_uses_[mesh] == 0) return std::move(scene_.meshes[mesh]);
  return scene_.meshes[mesh];
}

absl::StatusOr<Affine> SceneBaker::StillTransform(const TransformOverTime& t,
                                                  SourceLocation location) const {
  absl::StatusOr<AnimatedTransform> transform = AnimatedTransform::Make(t);
  if (!transform.ok()) {
    return Fail(location, absl::StrCat("the transform cannot place a shape: ",
                                       std::string(transform.status().message())));
  }
  return transform->At(geometry_.shutter_open);
}

absl::StatusOr<int32_t> SceneBaker::AddMotion(const TransformOverTime& t, Vec3d group_center,
                                              SourceLocation location) {
  absl::StatusOr<AnimatedTransform> transform = AnimatedTransform::Make(t);
  if (!transform.ok()) return Fail(location, std::string(transform.status().message()));
  geometry_.motions.push_back({*transform, group_center, geometry_.render_origin_world});
  return static_cast<int32_t>(geometry_.motions.size() - 1);
}

Surface SceneBaker::MakeSurface(int32_t shape_index) const {
  const ShapeDescription& shape = scene_.shapes[shape_index];
  const MaterialNeeds needs = NeedsOfMaterial(scene_, shape.material);
  Surface surface;
  surface.material = shape.material;
  surface.shape = shape_index;
  surface.flips_normal = shape.reverse_orientation;
  surface.has_alpha = shape.has_alpha;
  surface.may_pass = needs.may_pass;
  surface.is_sphere = std::holds_alternative<SphereShape>(shape.shape);
  surface.needs_tangent = needs.anisotropic;
  surface.reads_textures =
      needs.reads_textures || (shape.has_alpha && shape.alpha.texture != kNone);
  return surface;
}

absl::Status SceneBaker::AddMesh(const ShapeDescription& shape, Surface surface,
                                 const Affine& target_from_shape, bool may_emit,
                                 GeometryGroup* group) {
  TriangleMesh mesh = TakeMesh(std::get<MeshShape>(shape.shape).mesh);
  const Affine shape_from_target = Inverse(target_from_shape);
  BakedMesh baked;
  surface.flips_normal ^= target_from_shape.Determinant() < 0;
  baked.surface = surface;
  baked.positions = std::move(mesh.positions);
  for (Vec3f& p : baked.positions) {
    p = ToFloat(target_from_shape.Point(ToDouble(p)));
    if (!IsFinite(p)) {
      return Fail(shape.location, "Shape: a vertex leaves the range of float once it is placed");
    }
  }
  baked.positions.push_back({});
  baked.normals = std::move(mesh.normals);
  for (Vec3f& n : baked.normals) {
    const Vec3d turned = shape_from_target.TransposedVector(ToDouble(n));
    const double length = Length(turned);
    const double scale = (shape.reverse_orientation ? -1 : 1) / length;
    n = length > 0 && std::isfinite(length) ? ToFloat(turned * scale) : Vec3f{};
  }
  baked.uvs = std::move(mesh.uvs);
  baked.indices = std::move(mesh.indices);
  // Triangles without area can neither be met nor emit; they only disturb the tracer.
  size_t kept = 0;
  for (size_t i = 0; i + 2 < baked.indices.size(); i += 3) {
    const uint32_t* t = &baked.indices[i];
    const Vec3d p0 = ToDouble(baked.positions[t[0]]);
    const Vec3d area =
        Cross(ToDouble(baked.positions[t[1]]) - p0, ToDouble(baked.positions[t[2]]) - p0);
    if (!(LengthSquared(area) > 0)) {
      ++geometry_.degenerate_triangle_count;
      continue;
    }
    for (size_t k = 0; k < 3; ++k) baked.indices[kept + k] = t[k];
    kept += 3;
  }
  baked.indices.resize(kept);
  if (kept == 0) return absl::OkStatus();
  if (shape.area_light != kNone && may_emit) {
    const AreaLightDescription& light = scene_.area_lights[shape.area_light];
    baked.surface.emitter = emitters_.AddMesh(baked, light);
  }
  group->meshes.push_back(std::move(baked));
  return absl::OkStatus();
}

absl::Status SceneBaker::AddQuadric(const ShapeDescription& shape, Surface surface,
                                    const Affine& target_from_shape, bool may_emit,
                                    GeometryGroup* group) {
  const auto* sphere = std::get_if<SphereShape>(&shape.shape);
  BakedQuadric baked{surface, sphere != nullptr ? MakeQuadric(*sphere)
                                                : MakeQuadric(std::get<DiskShape>(shape.shape))};
  Quadric& q = baked.quadric;
  if (!(q.radius > 0) || !(q.phi_max > 0) || q.inner_radius >= q.radius ||
      (sphere != nullptr && q.z_min >= q.z_max)) {
    return Fail(shape.location,
                "Shape: a sphere or disk of no extent; give it a positive radius, "
                "phimax and z range");
  }
  q.target_from_object = target_from_shape;
  q.object_from_target = Inverse(target_from_shape);
  const std::array<Vec3f, 2> bounds = QuadricBounds(q);
  if (!IsFinite(bounds[0]) || !IsFinite(bounds[1])) {
    return Fail(shape.location, "Shape: it leaves the range of float once it is placed");
  }
  for (size_t i = 0; i < 3; ++i) {
    q.coordinate_max[i] = std::max(std::fabs(bounds[0][i]), std::fabs(bounds[1][i]));
  }
  if (shape.area_light != kNone && may_emit) {
    const std::string problem = emitters_.ProblemWith(q);
    if (!problem.empty()) return Fail(shape.location, problem);
    baked.surface.emitter =
        emitters_.AddQuadric(q, surface.flips_normal, scene_.area_lights[shape.area_light]);
  }
  group->quadrics.push_back(baked);
  return absl::OkStatus();
}

absl::Status SceneBaker::AddShape(int32_t shape_index, const Affine& target_from_shape,
                                  bool may_emit, GeometryGroup* group) {
  const ShapeDescription& shape = scene_.shapes[shape_index];
  if (shape.area_light != kNone && !may_emit) {
    return Fail(shape.location,
                "Shape: area lights that move or belong to an object definition are not supported; "
                "place the emissive shape in the world, at rest");
  }
  const Surface surface = MakeSurface(shape_index);
  if (std::holds_alternative<MeshShape>(shape.shape)) {
    return AddMesh(shape, surface, target_from_shape, may_emit, group);
  }
  return AddQuadric(shape, surface, target_from_shape, may_emit, group);
}

void SceneBaker::GrowBounds(const ShapeDescription& shape, const Affine& transform,
                            Bounds* bounds) const {
  if (const auto* mesh = std::get_if<MeshShape>(&shape.shape)) {
    for (const Vec3f& p : scene_.meshes[mesh->mesh].positions)
      bounds->Add(transform.Point(ToDouble(p)));
    return;
  }
  const auto* sphere = std::get_if<SphereShape>(&shape.shape);
  Quadric q =
      sphere != nullptr ? MakeQuadric(*sphere) : MakeQuadric(std::get<DiskShape>(shape.shape));
  q.target_from_object = transform;
  for (const Vec3f& p : QuadricBounds(q)) bounds->Add(ToDouble(p));
}

void SceneBaker::FinishGroup(GeometryGroup* group) {
  Bounds bounds;
  double radius_squared = 0;
  for (const BakedMesh& mesh : group->meshes) {
    for (const uint32_t i : mesh.indices) {
      const Vec3d p = ToDouble(mesh.positions[i]);
      bounds.Add(p);
      radius_squared = std::max(radius_squared, LengthSquared(p));
    }
  }
  for (const BakedQuadric& q : group->quadrics) {
    const std::array<Vec3f, 2> corners = QuadricBounds(q.quadric);
    for (const Vec3f& p : corners) bounds.Add(ToDouble(p));
    const Vec3d reach = ToDouble(q.quadric.coordinate_max);
    radius_squared = std::max(radius_squared, LengthSquared(reach));
  }
  if (bounds.empty()) return;
  group->bounds_lower = ToFloat(bounds.lower());
  group->bounds_upper = ToFloat(bounds.upper());
  group->radius = std::sqrt(radius_squared) * (1 + 1e-12);
}

absl::Status SceneBaker::BakeObjects() {
  for (const ObjectDefinition& object : scene_.objects) {
    std::vector<Affine> transforms;
    Bounds bounds;
    for (const int32_t index : object.shapes) {
      const ShapeDescription& shape = scene_.shapes[index];
      if (Moves(shape.world_from_object)) {
        return Fail(shape.location,
                    "Shape: motion within an object definition is not supported; "
                    "animate the instance instead");
      }
      absl::StatusOr<Affine> transform = StillTransform(shape.world_from_object, shape.location);
      if (!transform.ok()) return transform.status();
      transforms.push_back(*transform);
      GrowBounds(shape, *transform, &bounds);
    }
    GeometryGroup group;
    group.center = bounds.Center();
    for (size_t i = 0; i < object.shapes.size(); ++i) {
      transforms[i].offset = transforms[i].offset - group.center;
      const absl::Status status =
          AddShape(object.shapes[i], transforms[i], /*may_emit=*/false, &group);
      if (!status.ok()) return status;
    }
    FinishGroup(&group);
    geometry_.groups.push_back(std::move(group));
  }
  return absl::OkStatus();
}

absl::Status SceneBaker::BakeInstances() {
  for (const ObjectInstance& instance : scene_.instances) {
    PlacedGroup placed;
    placed.group = static_cast<uint32_t>(instance.object) + 1;
    const GeometryGroup& group = geometry_.groups[placed.group];
    if (group.meshes.empty() && group.quadrics.empty()) continue;
    if (Moves(instance.world_from_instance)) {
      absl::StatusOr<int32_t> motion =
          AddMotion(instance.world_from_instance, group.center, instance.location);
      if (!motion.ok()) return motion.status();
      placed.motion = *motion;
      placed.render_from_group =
          geometry_.motions[placed.motion].RenderFromGroup(geometry_.shutter_open);
    } else {
      absl::StatusOr<Affine> transform =
          StillTransform(instance.world_from_instance, instance.location);
      if (!transform.ok()) return transform.status();
      placed.render_from_group = *transform;
      placed.render_from_group.offset =
          transform->Point(group.center) - geometry_.render_origin_world;
    }
    placed.group_from_render = Inverse(placed.render_from_group);
    (placed.motion == kNone ? geometry_.still : geometry_.moving).push_back(placed);
  }
  return absl::OkStatus();
}

absl::Status SceneBaker::BakeWorldShapes() {
  for (const int32_t index : scene_.world_shapes) {
    const ShapeDescription& shape = scene_.shapes[index];
    if (!Moves(shape.world_from_object)) {
      absl::StatusOr<Affine> transform = StillTransform(shape.world_from_object, shape.location);
      if (!transform.ok()) return transform.status();
      transform->offset = transform->offset - geometry_.render_origin_world;
      const absl::Status status =
          AddShape(index, *transform, /*may_emit=*/true, &geometry_.groups[0]);
      if (!status.ok()) return status;
      continue;
    }
    // A moving shape is a group of its own, in the shape's own space, placed once.
    Bounds bounds;
    GrowBounds(shape, Affine{}, &bounds);
    GeometryGroup group;
    group.center = bounds.Center();
    Affine group_from_shape;
    group_from_shape.offset = -group.center;
    const absl::Status status = AddShape(index, group_from_shape, /*may_emit=*/false, &group);
    if (!status.ok()) return status;
    if (group.meshes.empty() && group.quadrics.empty()) continue;
    FinishGroup(&group);
    absl::StatusOr<int32_t> motion =
        AddMotion(shape.world_from_object, group.center, shape.location);
    if (!motion.ok()) return motion.status();
    PlacedGroup placed;
    placed.group = static_cast<uint32_t>(geometry_.groups.size());
    placed.motion = *motion;
    placed.render_from_group = geometry_.motions[*motion].RenderFromGroup(geometry_.shutter_open);
    placed.group_from_render = Inverse(placed.render_from_group);
    geometry_.groups.push_back(std::move(group));
    geometry_.moving.push_back(placed);
  }
  FinishGroup(&geometry_.groups[0]);
  return absl::OkStatus();
}

void SceneBaker::FinishSceneBounds() {
  Bounds bounds;
  const GeometryGroup& world = geometry_.groups[0];
  if (!world.meshes.empty() || !world.quadrics.empty()) {
    bounds.Add(ToDouble(world.bounds_lower));
    bounds.Add(ToDouble(world.bounds_upper));
  }
  for (const PlacedGroup& placed : geometry_.still) {
    const PlacedBounds box = BoundsOfStill(geometry_, placed);
    bounds.Add(ToDouble(box.lower));
    bounds.Add(ToDouble(box.upper));
  }
  for (const PlacedGroup& placed : geometry_.moving) {
    for (uint32_t step = 0; step < kMotionStepCount; ++step) {
      const PlacedBounds box = BoundsOfMoving(geometry_, placed, step);
      bounds.Add(ToDouble(box.lower));
      bounds.Add(ToDouble(box.upper));
    }
  }
  if (bounds.empty()) bounds.Add({0, 0, 0});
  geometry_.bounds_lower = ToFloat(bounds.lower());
  geometry_.bounds_upper = ToFloat(bounds.upper());
}

absl::StatusOr<BakedScene> SceneBaker::Bake() {
  geometry_.shutter_open = scene_.camera.shutter_open;
  geometry_.shutter_close = std::max(scene_.camera.shutter_open, scene_.camera.shutter_close);
  absl::StatusOr<Affine> camera =
      StillTransform(scene_.camera.world_from_camera, scene_.camera.location);
  if (!camera.ok()) return camera.status();
  geometry_.render_origin_world = camera->offset;
  CountMeshUses();
  geometry_.groups.emplace_back();
  for (absl::Status (SceneBaker::*step)() :
       {&SceneBaker::BakeObjects, &SceneBaker::BakeInstances, &SceneBaker::BakeWorldShapes}) {
    const absl::Status status = (this->*step)();
    if (!status.ok()) return status;
  }
  FinishSceneBounds();
  emitters_.AssignIds(&geometry_.groups[0]);
  BakedScene baked{std::move(geometry_), emitters_.Take()};
  baked.emitters.render_origin_world = baked.geometry.render_origin_world;
  scene_.meshes.clear();
  return baked;
}

}  // namespace

absl::StatusOr<BakedScene> BakeScene(SceneDescription* scene) { return SceneBaker(scene).Bake(); }

}  // namespace sheaf::render
