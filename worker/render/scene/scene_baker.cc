// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription > SceneGeometry: transforms in double, one rounding to float at the end.
#include "worker/render/scene/scene_baker.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/base/load_phases.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/scene/shape_baker.h"

namespace sheaf::render {
namespace {

// A shape that moves within its object: a group that each instance places on its own.
struct MovingPart {
  uint32_t group = 0;
  int32_t shape = kNone;
};

class SceneBaker {
 public:
  SceneBaker(SceneDescription* scene, EmissionMaps maps)
      : scene_(*scene), shapes_(scene, std::move(maps)) {}

  absl::StatusOr<BakedScene> Bake();

 private:
  absl::Status Fail(SourceLocation location, const std::string& what) const {
    return absl::InvalidArgumentError(absl::StrCat(FormatLocation(scene_, location), ": ", what));
  }
  bool Moves(const TransformOverTime& t) const {
    return t.IsAnimated() && geometry_.shutter_close > geometry_.shutter_open;
  }
  // Sets the origin of render space, after BakeObjects.
  absl::Status ChooseOrigin();
  // The bounds of all shapes, in the world. is_rough: of a few vertices of each mesh.
  Bounds WorldBounds(bool is_rough) const;
  absl::Status BakeObjects();
  // Makes a group of its own of a shape that moves, in its own space. Returns none if nothing of
  // it is left.
  absl::StatusOr<std::optional<uint32_t>> BakeMovingShape(int32_t index);
  absl::Status BakeInstances();
  absl::Status PlaceMovingPart(const ObjectInstance& instance, const MovingPart& part);
  absl::Status BakeWorldShapes();
  // The transform of a shape or instance that is static while the shutter is open.
  absl::StatusOr<Affine> StillTransform(const TransformOverTime& t, SourceLocation location) const;
  absl::StatusOr<int32_t> AddMotion(const TransformOverTime& t, Vec3d group_center,
                                    SourceLocation location);
  static void FinishGroup(GeometryGroup* group);
  void AddGroupBounds(const GeometryGroup& group, const Affine& world_from_group,
                      Bounds* bounds) const;
  // Where the file places the group.
  SourceLocation LocationOf(const PlacedGroup& placed) const;
  absl::Status AddPlacedBounds(const PlacedGroup& placed, const PlacedBounds& box,
                               Bounds* bounds) const;
  template <typename Mesh>
  void GrowReach(const Mesh& mesh, size_t vertex_count);
  absl::Status FinishSceneBounds();

  SceneDescription& scene_;
  SceneGeometry geometry_;
  ShapeBaker shapes_;
  std::vector<std::vector<MovingPart>> moving_parts_;  // By object.
};

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

void SceneBaker::FinishGroup(GeometryGroup* group) {
  Bounds bounds;
  double radius_squared = 0;
  const auto add_vertices = [&](const std::vector<Vec3f>& positions,
                                const std::vector<uint32_t>& indices) {
    for (const uint32_t i : indices) {
      const Vec3d p = ToDouble(positions[i]);
      bounds.Add(p);
      radius_squared = std::max(radius_squared, LengthSquared(p));
    }
  };
  for (const BakedMesh& mesh : group->meshes) {
    for (size_t step = 0; step <= mesh.steps.size(); ++step) {
      add_vertices(PositionsOfStep(mesh, step), mesh.indices);
    }
  }
  for (const BakedPatches& patches : group->patches) {
    add_vertices(patches.positions, patches.indices);
  }
  for (const BakedQuadric& q : group->quadrics) {
    const std::array<Vec3f, 2> corners = QuadricBounds(q.quadric);
    for (const Vec3f& p : corners) bounds.Add(ToDouble(p));
    const Vec3d reach = ToDouble(q.quadric.coordinate_max);
    radius_squared = std::max(radius_squared, LengthSquared(reach));
  }
  for (const BakedCurves& curves : group->curves) {
    Vec3f corner;
    for (const CurvePiece& piece : curves.pieces) {
      const CurveSegment segment = SegmentOf(curves.set, piece.segment);
      for (const Vec3f& p : CurveBounds(segment, piece, curves.target_from_shape)) {
        bounds.Add(ToDouble(p));
        corner = {std::max(corner.x, std::fabs(p.x)), std::max(corner.y, std::fabs(p.y)),
                  std::max(corner.z, std::fabs(p.z))};
      }
    }
    radius_squared = std::max(radius_squared, LengthSquared(ToDouble(corner)));
  }
  if (bounds.empty()) return;
  group->bounds_lower = ToFloat(bounds.lower());
  group->bounds_upper = ToFloat(bounds.upper());
  group->radius = std::sqrt(radius_squared) * (1 + 1e-12);
}

Bounds SceneBaker::WorldBounds(bool is_rough) const {
  Bounds bounds;
  for (const int32_t index : scene_.world_shapes) {
    const ShapeDescription& shape = scene_.shapes[index];
    for (const Matrix4& place : {shape.world_from_object.start, shape.world_from_object.end}) {
      const Affine world_from_shape = AffineOf(place);
      const auto* mesh_shape = std::get_if<MeshShape>(&shape.shape);
      if (!is_rough || mesh_shape == nullptr) {
        shapes_.GrowBounds(shape, world_from_shape, &bounds);
        continue;
      }
      const std::vector<Vec3f>& positions = scene_.meshes[mesh_shape->mesh].positions;
      if (positions.empty()) continue;
      for (const size_t i : {size_t{0}, positions.size() / 2, positions.size() - 1}) {
        bounds.Add(world_from_shape.Point(ToDouble(positions[i])));
      }
    }
  }
  for (const ObjectInstance& instance : scene_.instances) {
    const auto object = static_cast<size_t>(instance.object);
    for (const Matrix4& place :
         {instance.world_from_instance.start, instance.world_from_instance.end}) {
      AddGroupBounds(geometry_.groups[object + 1], AffineOf(place), &bounds);
      for (const MovingPart& part : moving_parts_[object]) {
        const TransformOverTime& motion = scene_.shapes[part.shape].world_from_object;
        for (const Matrix4& inner : {motion.start, motion.end}) {
          AddGroupBounds(geometry_.groups[part.group], AffineOf(place) * AffineOf(inner), &bounds);
        }
      }
    }
  }
  return bounds;
}

void SceneBaker::AddGroupBounds(const GeometryGroup& group, const Affine& world_from_group,
                                Bounds* bounds) const {
  if (group.empty()) return;
  for (int corner = 0; corner < 8; ++corner) {
    const auto side = [&](size_t i) {
      return static_cast<double>((corner >> i & 1) != 0 ? group.bounds_upper[i]
                                                        : group.bounds_lower[i]);
    };
    bounds->Add(world_from_group.Point(group.center + Vec3d{side(0), side(1), side(2)}));
  }
}

absl::Status SceneBaker::ChooseOrigin() {
  // From here on, the camera's coordinates would take twelve bits of those of the scene.
  constexpr double kFarInRadii = 4096;
  const absl::StatusOr<Affine> camera =
      StillTransform(scene_.camera.world_from_camera, scene_.camera.location);
  if (!camera.ok()) return camera.status();
  geometry_.render_origin_world = camera->offset;
  // Rays begin where the scene does only if there is nothing on the way.
  if (scene_.camera.medium != kNone) return absl::OkStatus();
  Vec3d center;
  double radius = 0;
  for (const bool is_rough : {true, false}) {
    const Bounds bounds = WorldBounds(is_rough);
    if (bounds.empty()) return absl::OkStatus();
    center = bounds.Center();
    radius = Length(bounds.upper() - center);
    if (!(Length(camera->offset - center) > kFarInRadii * radius)) return absl::OkStatus();
  }
  if (!(radius > 0)) return absl::OkStatus();
  geometry_.render_origin_world = center;
  geometry_.radius_if_far = radius;
  return absl::OkStatus();
}

absl::Status SceneBaker::BakeObjects() {
  for (const ObjectDefinition& object : scene_.objects) {
    std::vector<int32_t> still;
    std::vector<Affine> transforms;
    Bounds bounds;
    for (const int32_t index : object.shapes) {
      const ShapeDescription& shape = scene_.shapes[index];
      if (Moves(shape.world_from_object)) continue;
      still.push_back(index);
      absl::StatusOr<Affine> transform = StillTransform(shape.world_from_object, shape.location);
      if (!transform.ok()) return transform.status();
      transforms.push_back(*transform);
      shapes_.GrowBounds(shape, *transform, &bounds);
    }
    GeometryGroup group;
    group.center = bounds.Center();
    for (size_t i = 0; i < still.size(); ++i) {
      transforms[i].offset = transforms[i].offset - group.center;
      const absl::Status status =
          shapes_.AddShape(still[i], transforms[i], /*may_emit=*/false, &group);
      if (!status.ok()) return status;
    }
    FinishGroup(&group);
    geometry_.groups.push_back(std::move(group));
  }
  // After the groups of all objects, which their instances find by number.
  for (const ObjectDefinition& object : scene_.objects) {
    std::vector<MovingPart>& parts = moving_parts_.emplace_back();
    for (const int32_t index : object.shapes) {
      if (!Moves(scene_.shapes[index].world_from_object)) continue;
      const absl::StatusOr<std::optional<uint32_t>> group = BakeMovingShape(index);
      if (!group.ok()) return group.status();
      if (group->has_value()) parts.push_back({**group, index});
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<uint32_t>> SceneBaker::BakeMovingShape(int32_t index) {
  Bounds bounds;
  shapes_.GrowBounds(scene_.shapes[index], Affine{}, &bounds);
  GeometryGroup group;
  group.center = bounds.Center();
  Affine group_from_shape;
  group_from_shape.offset = -group.center;
  const absl::Status status = shapes_.AddShape(index, group_from_shape, /*may_emit=*/false, &group);
  if (!status.ok()) return status;
  if (group.empty()) return std::nullopt;
  FinishGroup(&group);
  geometry_.groups.push_back(std::move(group));
  return static_cast<uint32_t>(geometry_.groups.size() - 1);
}

absl::Status SceneBaker::PlaceMovingPart(const ObjectInstance& instance, const MovingPart& part) {
  const ShapeDescription& shape = scene_.shapes[part.shape];
  absl::StatusOr<AnimatedTransform> placed_from_shape =
      AnimatedTransform::Make(shape.world_from_object);
  if (!placed_from_shape.ok()) {
    return Fail(shape.location, std::string(placed_from_shape.status().message()));
  }
  PlacedGroup placed;
  placed.instance = static_cast<int32_t>(&instance - scene_.instances.data());
  placed.group = part.group;
  absl::StatusOr<int32_t> motion = AddMotion(
      instance.world_from_instance, geometry_.groups[part.group].center, instance.location);
  if (!motion.ok()) return motion.status();
  placed.motion = *motion;
  geometry_.motions[*motion].placed_from_shape = *placed_from_shape;
  placed.render_from_group = geometry_.motions[*motion].RenderFromGroup(geometry_.shutter_open);
  placed.group_from_render = Inverse(placed.render_from_group);
  geometry_.moving.push_back(placed);
  return absl::OkStatus();
}

absl::Status SceneBaker::BakeInstances() {
  for (const ObjectInstance& instance : scene_.instances) {
    for (const MovingPart& part : moving_parts_[static_cast<size_t>(instance.object)]) {
      const absl::Status status = PlaceMovingPart(instance, part);
      if (!status.ok()) return status;
    }
    PlacedGroup placed;
    placed.instance = static_cast<int32_t>(&instance - scene_.instances.data());
    placed.group = static_cast<uint32_t>(instance.object) + 1;
    const GeometryGroup& group = geometry_.groups[placed.group];
    if (group.empty()) continue;
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
          shapes_.AddShape(index, *transform, /*may_emit=*/true, &geometry_.groups[0]);
      if (!status.ok()) return status;
      continue;
    }
    const absl::StatusOr<std::optional<uint32_t>> group = BakeMovingShape(index);
    if (!group.ok()) return group.status();
    if (!group->has_value()) continue;
    absl::StatusOr<int32_t> motion =
        AddMotion(shape.world_from_object, geometry_.groups[**group].center, shape.location);
    if (!motion.ok()) return motion.status();
    PlacedGroup placed;
    placed.group = **group;
    placed.motion = *motion;
    placed.render_from_group = geometry_.motions[*motion].RenderFromGroup(geometry_.shutter_open);
    placed.group_from_render = Inverse(placed.render_from_group);
    geometry_.moving.push_back(placed);
  }
  FinishGroup(&geometry_.groups[0]);
  return absl::OkStatus();
}

SourceLocation SceneBaker::LocationOf(const PlacedGroup& placed) const {
  if (placed.instance != kNone) return scene_.instances[placed.instance].location;
  const GeometryGroup& group = geometry_.groups[placed.group];  // The group of one moving shape.
  const Surface& surface = !group.meshes.empty()     ? group.meshes[0].surface
                           : !group.patches.empty()  ? group.patches[0].surface
                           : !group.quadrics.empty() ? group.quadrics[0].surface
                                                     : group.curves[0].surface;
  return scene_.shapes[surface.shape].location;
}

absl::Status SceneBaker::AddPlacedBounds(const PlacedGroup& placed, const PlacedBounds& box,
                                         Bounds* bounds) const {
  if (!IsTraced(box.lower) || !IsTraced(box.upper)) {
    return Fail(LocationOf(placed),
                "it reaches farther than 1e18 from the camera, which rays cannot trace; scale the "
                "scene down");
  }
  bounds->Add(ToDouble(box.lower));
  bounds->Add(ToDouble(box.upper));
  return absl::OkStatus();
}

template <typename Mesh>
void SceneBaker::GrowReach(const Mesh& mesh, size_t vertex_count) {
  for (size_t v = 0; v < vertex_count; ++v) {
    const Vec3f& p = mesh.positions[v];
    const Vec3d reach = FileReach(mesh.target_from_shape, mesh.shape_from_target, ToDouble(p));
    for (size_t i = 0; i < 3; ++i) {
      geometry_.reach[i] = std::max(geometry_.reach[i], static_cast<float>(reach[i]));
    }
  }
}

absl::Status SceneBaker::FinishSceneBounds() {
  Bounds bounds;
  const GeometryGroup& world = geometry_.groups[0];
  if (!world.empty()) {
    bounds.Add(ToDouble(world.bounds_lower));
    bounds.Add(ToDouble(world.bounds_upper));
  }
  for (const PlacedGroup& placed : geometry_.still) {
    const absl::Status status = AddPlacedBounds(placed, BoundsOfStill(geometry_, placed), &bounds);
    if (!status.ok()) return status;
  }
  for (const PlacedGroup& placed : geometry_.moving) {
    for (uint32_t step = 0; step < kMotionStepCount; ++step) {
      const absl::Status status =
          AddPlacedBounds(placed, BoundsOfMoving(geometry_, placed, step), &bounds);
      if (!status.ok()) return status;
    }
  }
  if (bounds.empty()) bounds.Add({0, 0, 0});
  geometry_.bounds_lower = ToFloat(bounds.lower());
  geometry_.bounds_upper = ToFloat(bounds.upper());
  for (const BakedMesh& mesh : world.meshes)
    GrowReach(mesh, mesh.positions.size() - 1);  // The last is padding.
  for (const BakedPatches& patches : world.patches) GrowReach(patches, patches.positions.size());
  for (size_t i = 0; i < 3; ++i) {
    geometry_.reach[i] +=
        std::max(std::fabs(geometry_.bounds_lower[i]), std::fabs(geometry_.bounds_upper[i]));
  }
  return absl::OkStatus();
}

absl::StatusOr<BakedScene> SceneBaker::Bake() {
  geometry_.shutter_open = scene_.camera.shutter_open;
  geometry_.shutter_close = std::max(scene_.camera.shutter_open, scene_.camera.shutter_close);
  geometry_.groups.emplace_back();
  for (absl::Status (SceneBaker::*step)() :
       {&SceneBaker::BakeObjects, &SceneBaker::ChooseOrigin, &SceneBaker::BakeInstances,
        &SceneBaker::BakeWorldShapes, &SceneBaker::FinishSceneBounds}) {
    const absl::Status status = (this->*step)();
    if (!status.ok()) return status;
  }
  geometry_.degenerate_triangle_count = shapes_.degenerate_triangle_count();
  LightTableInput emitters = shapes_.TakeEmitters(&geometry_.groups[0]);
  IndexEmitters(&geometry_);
  BakedScene baked{std::move(geometry_), std::move(emitters)};
  baked.emitters.render_origin_world = baked.geometry.render_origin_world;
  scene_.meshes.clear();
  scene_.bilinear_meshes.clear();
  return baked;
}

}  // namespace

absl::StatusOr<BakedScene> BakeScene(SceneDescription* scene, EmissionMaps maps) {
  const PhaseTimer timer(LoadPhase::kGeometry);
  return SceneBaker(scene, std::move(maps)).Bake();
}

}  // namespace sheaf::render
