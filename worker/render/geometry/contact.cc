// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Planes of hits in double, their bounds, and the order of surfaces at one place.
#include "worker/render/geometry/contact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "worker/render/geometry/deforming_mesh.h"

namespace sheaf::render {
namespace {

Vec3d Abs(Vec3d v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }

// A plane in the space of a group.
struct Plane {
  Vec3d n;  // Unit, on the front.
  double t = 0;
  Vec3d coordinate_max;  // Bound of the coordinates from which it was computed.
  double t_error = 0;    // The relative error of t.
  double height = 0;     // Least height of a triangle; 0 where the surface is known exactly.
  double corner_error = 0;
  double radius = 0;  // Least radius of curvature, or a lower bound; 0: flat.
  const Surface* surface = nullptr;
};

// Grows the bound by a vertex: it was rounded to float in the file and again in the group.
template <typename Mesh>
void Grow(const Mesh& mesh, Vec3d p, Vec3d* coordinate_max) {
  const Vec3d in_file = FileReach(mesh.target_from_shape, mesh.shape_from_target, p);
  for (size_t i = 0; i < 3; ++i) {
    (*coordinate_max)[i] = std::fmax((*coordinate_max)[i], std::fabs(p[i]) + in_file[i]);
  }
}

// The tracer rounds t to float once.
constexpr double kFloatRounding = 0x1p-23;

std::optional<Plane> PlaneOfTriangle(const BakedMesh& mesh, uint32_t triangle, Vec3d o, Vec3d d,
                                     float time) {
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(triangle)];
  Plane plane;
  plane.surface = &mesh.surface;
  std::array<Vec3d, 3> corners;
  if (mesh.steps.empty()) {
    corners = CornersAt(mesh, t, time);
  } else {
    const DeformedTriangle deformed = DeformedTriangleAt(mesh, t, VertexTimeAt(mesh, time));
    corners = deformed.corners;
    plane.coordinate_max = ToDouble(deformed.coordinate_max);
    plane.corner_error = CornerErrorOf(mesh, deformed);
  }
  for (const Vec3d& corner : corners) Grow(mesh, corner, &plane.coordinate_max);
  const Vec3d e1 = corners[1] - corners[0], e2 = corners[2] - corners[0];
  const Vec3d cross = Cross(e1, e2);
  const double area = Length(cross);
  const double longest =
      std::sqrt(std::max(LengthSquared(e1), std::max(LengthSquared(e2), LengthSquared(e2 - e1))));
  if (!(area > 0)) return std::nullopt;
  plane.n = cross * (static_cast<double>(TriangleFacing(mesh, t, cross)) / area);
  plane.height = area / longest;
  plane.t = Dot(plane.n, corners[0] - o) / Dot(plane.n, d);
  return plane;
}

// A lower bound of the radius of curvature.
double RadiusOf(const Quadric& quadric) {
  if (quadric.kind == Quadric::Kind::kDisk) return 0;
  const double shrinks = std::sqrt(LengthSquared(quadric.object_from_target.Vector({1, 0, 0})) +
                                   LengthSquared(quadric.object_from_target.Vector({0, 1, 0})) +
                                   LengthSquared(quadric.object_from_target.Vector({0, 0, 1})));
  const double grows = std::sqrt(LengthSquared(quadric.target_from_object.Vector({1, 0, 0})) +
                                 LengthSquared(quadric.target_from_object.Vector({0, 1, 0})) +
                                 LengthSquared(quadric.target_from_object.Vector({0, 0, 1})));
  // The least axis squared over the largest one.
  return quadric.radius / (shrinks * shrinks * grows);
}

Plane PlaneOfQuadric(const BakedQuadric& baked, double t, Vec3d o, Vec3d d) {
  const QuadricPoint on = QuadricPointAt(baked.quadric, o, d, t);
  Plane plane;
  plane.surface = &baked.surface;
  plane.n = baked.surface.flips_normal ? -on.n : on.n;
  plane.coordinate_max = ToDouble(baked.quadric.coordinate_max);
  plane.t = t;
  plane.t_error = kFloatRounding;
  plane.radius = RadiusOf(baked.quadric);
  return plane;
}

std::optional<Plane> PlaneOfPatch(const BakedPatches& baked, const RawHit& hit) {
  const BilinearPatch patch = baked.PatchAt(hit.id.primitive);
  const uint32_t* k = &baked.indices[4 * static_cast<size_t>(hit.id.primitive)];
  Plane plane;
  plane.surface = &baked.surface;
  const Vec3d n = patch.NormalAt(static_cast<double>(hit.u), static_cast<double>(hit.v));
  const double length = Length(n);
  if (!(length > 0)) return std::nullopt;
  plane.n = n * ((baked.surface.flips_normal ? -1 : 1) / length);
  if (!baked.normals.empty()) {
    const Vec3f sum =
        baked.normals[k[0]] + baked.normals[k[1]] + baked.normals[k[2]] + baked.normals[k[3]];
    if (Dot(ToDouble(sum), plane.n) < 0) plane.n = -plane.n;
  }
  for (size_t c = 0; c < 4; ++c) {
    Grow(baked, ToDouble(baked.positions[k[c]]), &plane.coordinate_max);
  }
  plane.t = static_cast<double>(hit.t);
  plane.t_error = kFloatRounding;
  return plane;
}

// Where a surface stands among those at one place, along a ray: first by layer, then by depth.
using Position = std::pair<int, double>;

Position PositionAlong(const Contact& contact, Vec3d p, Vec3d d) {
  const Surface& surface = *contact.surface;
  const double along = Dot(contact.n, d);
  if (surface.is_boundary) {
    // Left: before everything that touches it, the inner of two first. Entered: the opposite.
    return along > 0 ? Position{-2, contact.area} : Position{2, -contact.area};
  }
  const bool lights_front_only = surface.emitter != kNoEmitter && surface.emits_on_front_only;
  // The camera is the origin of render space.
  const bool outer_is_front = lights_front_only || Dot(contact.n, p) < 0;
  const bool comes_from_outside = (along < 0) == outer_is_front;
  const int layer = surface.emitter == kNoEmitter ? 0 : 1;
  return comes_from_outside ? Position{-layer, contact.area} : Position{layer, -contact.area};
}

}  // namespace

std::optional<Contact> ContactAt(const SceneGeometry& geometry, const Ray& ray, const RawHit& hit) {
  const PrimitiveId& id = hit.id;
  Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const PlacedGroup* placed = nullptr;
  Affine render_from_group, group_from_render;
  if (id.placed != kNotPlaced) {
    placed = &PlacedAt(geometry, id.placed);
    render_from_group = RenderFromGroupAt(geometry, *placed, ray.time);
    group_from_render = GroupFromRenderAt(geometry, *placed, ray.time);
    o = group_from_render.Point(o);
    d = group_from_render.Vector(d);
  }
  const GeometryGroup& group = geometry.groups[placed == nullptr ? 0 : placed->group];
  std::optional<Plane> plane;
  if (id.geometry < group.QuadricsId()) {
    plane = PlaneOfTriangle(group.meshes[id.geometry], id.primitive, o, d, ray.time);
  } else if (id.geometry == group.QuadricsId()) {
    plane = PlaneOfQuadric(group.quadrics[id.primitive], static_cast<double>(hit.t), o, d);
  } else if (id.geometry < group.CurvesId(0)) {
    plane = PlaneOfPatch(group.patches[id.geometry - group.PatchesId(0)], hit);
  }
  if (!plane) return std::nullopt;
  // The ray is rounded again in the space of a placed group.
  const Vec3d with_ray = plane->coordinate_max + Abs(o);
  double bound = static_cast<double>(Gamma(2)) *
                     Dot(Abs(plane->n), placed == nullptr ? plane->coordinate_max : with_ray) +
                 plane->corner_error;
  double doubt = static_cast<double>(kPlaneRounding) * Dot(Abs(plane->n), with_ray);
  Contact contact;
  contact.tilt = 0x1p-20;
  if (plane->radius > 0) {
    // The point is known within the rounding of coordinates, and the normal turns with it.
    const double beside = static_cast<double>(Gamma(4)) * (with_ray.x + with_ray.y + with_ray.z);
    contact.tilt += std::min(0.25, beside / plane->radius);
  }
  if (plane->height > 0) contact.tilt += std::min(0.25, bound / plane->height);
  contact.t = plane->t;
  contact.n = plane->n;
  contact.area = plane->surface->area;
  if (placed != nullptr) {
    contact.n = group_from_render.TransposedVector(plane->n);
    const double scale = 1 / Length(contact.n);
    contact.n = contact.n * scale;
    bound *= scale;
    doubt *= scale;
    const double size = std::cbrt(std::fabs(render_from_group.Determinant()));
    contact.area *= size * size;
  }
  const double along = std::fabs(Dot(contact.n, ToDouble(ray.d)));
  if (!(along > 0) || !std::isfinite(contact.t)) return std::nullopt;
  contact.bound = bound + plane->t_error * std::fabs(contact.t) * along;
  contact.doubt = doubt + contact.bound;
  contact.surface = plane->surface;
  contact.id = id;
  return contact;
}

std::optional<Contact> ContactOfSource(const SceneGeometry& geometry, const Ray& ray) {
  RawHit hit;
  hit.id = ray.source;
  Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  uint32_t index = 0;
  if (hit.id.placed != kNotPlaced) {
    const PlacedGroup& placed = PlacedAt(geometry, hit.id.placed);
    const Affine group_from_render = GroupFromRenderAt(geometry, placed, ray.time);
    o = group_from_render.Point(o);
    d = group_from_render.Vector(d);
    index = placed.group;
  }
  const GeometryGroup& group = geometry.groups[index];
  constexpr float kNoEnd = std::numeric_limits<float>::infinity();
  if (hit.id.geometry == group.QuadricsId()) {
    const std::optional<double> t =
        IntersectQuadric(group.quadrics[hit.id.primitive].quadric, o, d, kNoEnd);
    if (!t) return std::nullopt;
    hit.t = static_cast<float>(*t);
  } else if (hit.id.geometry > group.QuadricsId() && hit.id.geometry < group.CurvesId(0)) {
    const BakedPatches& patches = group.patches[hit.id.geometry - group.PatchesId(0)];
    const std::optional<PatchHit> found =
        IntersectPatch(patches.PatchAt(hit.id.primitive), o, d, kNoEnd);
    if (!found) return std::nullopt;
    hit.t = static_cast<float>(found->t);
    hit.u = static_cast<float>(found->u);
    hit.v = static_cast<float>(found->v);
  }
  return ContactAt(geometry, ray, hit);
}

bool AreOnePlace(const Contact& a, const Contact& b, Vec3d d) {
  const double along = std::max(std::fabs(Dot(a.n, d)), std::fabs(Dot(b.n, d)));
  return std::fabs(a.t - b.t) * along <= a.bound + b.bound &&
         Length(Cross(a.n, b.n)) <= a.tilt + b.tilt;
}

int OrderAlong(const Contact& a, const Contact& b, const Ray& ray) {
  if (a.id == b.id) return 0;
  const bool is_one_shape = a.surface == b.surface && a.id.placed == b.id.placed;
  // Faces of one body that share an edge meet there, and are crossed once.
  if (is_one_shape && a.surface->is_boundary && Dot(a.n, b.n) > 0) return 0;
  const Vec3d d = ToDouble(ray.d), p = ToDouble(ray.o) + d * a.t;
  const Position of_a = PositionAlong(a, p, d), of_b = PositionAlong(b, p, d);
  if (of_a != of_b) return of_a < of_b ? -1 : 1;
  // Equal boundaries of different media are both crossed, and of equal emitters one alone is seen:
  // which comes first does not matter, as long as the opposite ray meets them in the opposite
  // order.
  const MediumBoundary &media_of_a = a.surface->media, &media_of_b = b.surface->media;
  const bool has_same_media =
      media_of_a.inside == media_of_b.inside && media_of_a.outside == media_of_b.outside;
  if (a.surface->emitter == kNoEmitter && (!a.surface->is_boundary || has_same_media)) return 0;
  const bool leaves = (Dot(a.n, d) > 0) == (Dot(a.n, p) > 0);
  return (a.id < b.id) == leaves ? -1 : 1;
}

}  // namespace sheaf::render
