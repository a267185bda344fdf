// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/integrator/first_hit.h"

#include <cmath>
#include <optional>

#include "worker/render/geometry/deforming_mesh.h"

namespace sheaf::render {
namespace {

float* Put(Vec3d v, float* at) {
  for (size_t i = 0; i < 3; ++i) *at++ = static_cast<float>(v[i]);
  return at;
}
float* Put(Vec2d v, float* at) {
  *at++ = static_cast<float>(v.x);
  *at++ = static_cast<float>(v.y);
  return at;
}

// Projects to the film the surface point that was hit at `time`, at another time of the shutter.
std::optional<Vec2d> FilmPointAt(const CompiledScene& scene, const SurfacePoint& point, float time,
                                 float other_time) {
  const Vec3d p = ToDouble(point.p);
  const SceneGeometry& geometry = scene.geometry;
  const size_t still_count = geometry.still.size();
  const PlacedGroup* placed = nullptr;
  if (point.id.placed != kNotPlaced) {
    placed = point.id.placed < still_count ? &geometry.still[point.id.placed]
                                           : &geometry.moving[point.id.placed - still_count];
  }
  const GeometryGroup& group = geometry.groups[placed == nullptr ? 0 : placed->group];
  const bool deforms =
      point.id.geometry < group.meshes.size() && !group.meshes[point.id.geometry].steps.empty();
  if (!deforms && (placed == nullptr || placed->motion == kNone)) {
    return scene.camera.FilmPointOf(p, other_time);
  }
  Vec3d in_group = p;
  if (placed != nullptr) in_group = GroupFromRenderAt(geometry, *placed, time).Point(p);
  if (deforms) {
    in_group =
        CarryOver(group.meshes[point.id.geometry], point.id.primitive, in_group, time, other_time);
  }
  if (placed != nullptr) {
    in_group = RenderFromGroupAt(geometry, *placed, other_time).Point(in_group);
  }
  return scene.camera.FilmPointOf(in_group, other_time);
}

// Film points diverge near the camera's plane, and do not exist behind it.
constexpr double kMotionMaxPx = 1e6;

// Pixels over the shutter interval; 0 where the point is outside the camera's view at either end.
Vec2d Motion(const CompiledScene& scene, const SurfacePoint& point, float time) {
  const std::optional<Vec2d> open = FilmPointAt(scene, point, time, 0);
  const std::optional<Vec2d> close = FilmPointAt(scene, point, time, 1);
  if (!open || !close) return {0, 0};
  const Vec2d motion{close->x - open->x, close->y - open->y};
  const bool bounded = std::fabs(motion.x) <= kMotionMaxPx && std::fabs(motion.y) <= kMotionMaxPx;
  return bounded ? motion : Vec2d{0, 0};
}

}  // namespace

void RecordFirstHit(const CompiledScene& scene, const Ray& ray, const SurfacePoint& point,
                    OutputSample* outputs) {
  const FilmOutputs& wanted = scene.settings.outputs;
  float* at = outputs->means.data();  // In the order of Aov.
  Affine output_from_render;
  output_from_render.offset = scene.geometry.render_origin_world;
  if (wanted.camera_space) output_from_render = scene.camera.CameraFromRenderAt(ray.time);
  const Affine render_from_output = Inverse(output_from_render);
  const auto place_normal = [&](Vec3f n) {
    const Vec3d facing = ToDouble(Dot(ray.d, point.ng) > 0 ? -n : n);
    return Normalize(render_from_output.TransposedVector(facing));
  };
  if (wanted.Has(Aov::kPosition)) at = Put(output_from_render.Point(ToDouble(point.p)), at);
  if (wanted.Has(Aov::kGeometricNormal)) at = Put(place_normal(point.ng), at);
  if (wanted.Has(Aov::kShadingNormal)) at = Put(place_normal(point.shading.n), at);
  if (wanted.Has(Aov::kUv)) at = Put(Vec2d{point.uv.x, point.uv.y}, at);
  if (wanted.Has(Aov::kMotion)) Put(Motion(scene, point, ray.time), at);
  for (size_t i = 0; i < kIdKindCount; ++i) {
    const auto kind = static_cast<IdKind>(i);
    if (wanted.HasIds(kind)) outputs->ids[i] = scene.ids.IdOf(kind, point);
  }
}

void RecordFirstEventInMedium(const CompiledScene& scene, const Ray& ray, Vec3f p,
                              OutputSample* outputs) {
  const FilmOutputs& wanted = scene.settings.outputs;
  SurfacePoint point;
  point.p = p;
  float* at = outputs->means.data();  // In the order of Aov; surface values stay 0.
  Affine output_from_render;
  output_from_render.offset = scene.geometry.render_origin_world;
  if (wanted.camera_space) output_from_render = scene.camera.CameraFromRenderAt(ray.time);
  if (wanted.Has(Aov::kPosition)) at = Put(output_from_render.Point(ToDouble(p)), at);
  if (wanted.Has(Aov::kGeometricNormal)) at += 3;
  if (wanted.Has(Aov::kShadingNormal)) at += 3;
  if (wanted.Has(Aov::kUv)) at += 2;
  if (wanted.Has(Aov::kMotion)) Put(Motion(scene, point, ray.time), at);
}

}  // namespace sheaf::render
