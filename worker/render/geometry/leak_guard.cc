// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds closed meshes, and decides about rays that hit nothing.
#include "worker/render/geometry/leak_guard.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

#include "common/math/frame.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/needle.h"

namespace sheaf::render {

namespace {

float LengthOf(Vec3f d) { return static_cast<float>(Length(ToDouble(d))); }

// The ray turned by `step` radians to a side, a unit vector across it. The tracer's rounding grows
// with the coordinates as well as with the distance, so that the origin moves too.
Ray TurnedTo(const Ray& ray, Vec3f side, float step) {
  Ray turned = ray;
  turned.o = ray.o + (step * ReachOfOrigin(ray)) * side;
  turned.d = ray.d + (step * LengthOf(ray.d)) * side;
  return turned;
}

}  // namespace

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

Ray NudgedRay(const Ray& ray, int attempt, int widening) {
  // Each ray has sides of its own, so that no slit lies along those of all rays: eight turns of an
  // eighth of a right angle, chosen by the digits of the ray. Most rays need the first side alone.
  static constexpr std::array<std::array<float, 2>, 8> kTurns = {{{1, 0},
                                                                  {0.98078528f, 0.19509032f},
                                                                  {0.92387953f, 0.38268343f},
                                                                  {0.83146961f, 0.55557023f},
                                                                  {0.70710678f, 0.70710678f},
                                                                  {0.55557023f, 0.83146961f},
                                                                  {0.38268343f, 0.92387953f},
                                                                  {0.19509032f, 0.98078528f}}};
  const uint32_t digits = std::bit_cast<uint32_t>(ray.d.x) ^ std::bit_cast<uint32_t>(ray.d.y) ^
                          std::bit_cast<uint32_t>(ray.d.z) ^ std::bit_cast<uint32_t>(ray.o.x);
  const std::array<float, 2>& turn = kTurns[(digits * 0x9e3779b9u) >> 29];
  const auto [c, s] = turn;
  // The sides of attempts 0 to 3 are a quarter turn apart.
  const float along_t = attempt % 2 == 0 ? c : -s, along_b = attempt % 2 == 0 ? s : c;
  const float sign = attempt % 4 < 2 ? 1.0f : -1.0f;
  const Frame frame = Frame::FromNormal(ray.d / LengthOf(ray.d));
  const Vec3f side = sign * (along_t * frame.t + along_b * frame.b);
  const float step =
      (attempt < kWideNudgeCount ? 0x1p-19f : 0x1p-21f) * static_cast<float>(1 << widening);
  return TurnedTo(ray, side, step);
}

Ray BesideEdge(const SceneGeometry& geometry, const Ray& ray, const RawHit& hit,
               float turn_radians) {
  const bool is_placed = hit.id.placed != kNotPlaced;
  const PlacedGroup* placed = is_placed ? &PlacedAt(geometry, hit.id.placed) : nullptr;
  const GeometryGroup& group = geometry.groups[is_placed ? placed->group : 0];
  const BakedMesh& mesh = group.meshes[hit.id.geometry];
  std::array<Vec3d, 3> corners =
      CornersAt(mesh, &mesh.indices[3 * static_cast<size_t>(hit.id.primitive)], ray.time);
  if (is_placed) {
    const Affine render_from_group = RenderFromGroupAt(geometry, *placed, ray.time);
    for (Vec3d& corner : corners) corner = render_from_group.Point(corner);
  }
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  // The plane through the ray's origin, along the ray and an edge: the farthest outside of one.
  Vec3d outwards;
  double farthest = -std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < 3; ++i) {
    const Vec3d from = corners[i], to = corners[(i + 1) % 3], opposite = corners[(i + 2) % 3];
    const Vec3d normal = Cross(to - from, d);
    const double length = Length(normal), inside = Dot(opposite - from, normal);
    if (!(length > 0) || inside == 0) continue;
    const Vec3d out = normal * ((inside < 0 ? 1 : -1) / length);
    const double outside = Dot(o - from, out);
    if (outside <= farthest) continue;
    farthest = outside;
    outwards = out;
  }
  return TurnedTo(ray, ToFloat(outwards), turn_radians);
}

}  // namespace sheaf::render
