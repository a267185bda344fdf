// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds closed meshes, and decides about rays that hit nothing.
#include "worker/render/geometry/leak_guard.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/needle.h"

namespace sheaf::render {

EnclosedSide EnclosedSideOf(const BakedMesh& mesh) {
  const EnclosedSide side = EnclosedSideOf(mesh.positions, mesh.indices);
  for (const VertexStep& step : mesh.steps) {
    if (EnclosedSideOf(step.positions, mesh.indices) != side) return EnclosedSide::kNeither;
  }
  return side;
}

LeakGuard::LeakGuard(const SceneGeometry& geometry) : geometry_(&geometry) {
  for (const GeometryGroup& group : geometry.groups) {
    std::vector<EnclosedSide>& sides = sides_.emplace_back();
    for (const BakedMesh& mesh : group.meshes) {
      sides.push_back(EnclosedSideOf(mesh));
    }
  }
}

bool LeakGuard::MayLeak(const Ray& ray) const {
  if (ray.d == Vec3f{}) return false;
  const PrimitiveId source = ray.source;
  if (source == PrimitiveId{}) return !outside_is_dark_;
  const PlacedGroup* placed = nullptr;
  if (source.placed != kNotPlaced) placed = &PlacedAt(*geometry_, source.placed);
  const uint32_t group = placed == nullptr ? 0 : placed->group;
  const std::vector<EnclosedSide>& sides = sides_[group];
  if (source.geometry >= sides.size()) return !outside_is_dark_;
  const EnclosedSide side = sides[source.geometry];
  if (side == EnclosedSide::kNeither) return !outside_is_dark_;
  const BakedMesh& mesh = geometry_->groups[group].meshes[source.geometry];
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(source.primitive)];
  const auto [a, b, c] = CornersAt(mesh, t, ray.time);
  const Vec3d front = Cross(b - a, c - a);
  Vec3d d = ToDouble(ray.d);
  if (placed != nullptr) d = GroupFromRenderAt(*geometry_, *placed, ray.time).Vector(d);
  return (Dot(front, d) > 0) == (side == EnclosedSide::kFront);
}

bool LeakGuard::TouchesAtEdge(const Ray& ray, RawHit* hit) const {
  Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  uint32_t index = 0;
  if (hit->id.placed != kNotPlaced) {
    const PlacedGroup& placed = PlacedAt(*geometry_, hit->id.placed);
    const Affine group_from_render = GroupFromRenderAt(*geometry_, placed, ray.time);
    o = group_from_render.Point(o);
    d = group_from_render.Vector(d);
    index = placed.group;
  }
  const GeometryGroup& group = geometry_->groups[index];
  if (hit->id.geometry >= group.meshes.size()) return false;  // Doubles leave no holes.
  const BakedMesh& mesh = group.meshes[hit->id.geometry];
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(hit->id.primitive)];
  double corner_error = 0;
  if (!mesh.steps.empty()) {
    corner_error = CornerErrorOf(mesh, DeformedTriangleAt(mesh, t, VertexTimeAt(mesh, ray.time)));
  }
  const std::optional<TriangleHit> found =
      IntersectTriangle(o, d, CornersAt(mesh, t, ray.time), corner_error);
  if (!found) return false;
  hit->t = static_cast<float>(found->t);
  hit->u = static_cast<float>(found->u);
  hit->v = static_cast<float>(found->v);
  return hit->t > 0;
}

Ray NudgedRay(const Ray& ray, int attempt) {
  Ray nudged = ray;
  const Vec3d d = ToDouble(ray.d);
  const Frame frame = Frame::FromNormal(ToFloat(Normalize(d)));
  const uint64_t state = HashOfPoint(ray.d, HashOfPoint(ray.o, 0));
  const double turns = static_cast<double>(state >> 32) * 0x1p-32 + 0.25 * attempt;
  const double angle = 2 * std::numbers::pi * turns;
  const bool is_wide = attempt < kWideNudgeCount;
  const Vec3d side = ToDouble(frame.t) * Cos(angle) + ToDouble(frame.b) * Sin(angle);
  const Vec3f o = Abs(ray.o);
  // The tracer's rounding grows with the coordinates as well as with the distance.
  const double step = std::ldexp(1, is_wide ? -19 : -21);
  nudged.o = ToFloat(ToDouble(ray.o) +
                     side * (step * static_cast<double>(std::max(o.x, std::max(o.y, o.z)))));
  nudged.d = ToFloat(d + side * (step * Length(d)));
  return nudged;
}

}  // namespace sheaf::render
