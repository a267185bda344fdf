// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SurfacePoint: the properties of a hit for shading. The point is projected back onto its triangle
// (quadric, patch, curve) in double from the surface's own description, so its error is that of one
// rounding to float, however far the ray's origin is. Source: pbrt-v4, sec. 6.8.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>

#include "common/math/frame.h"
#include "common/math/vec.h"
#include "worker/render/geometry/emission_cells.h"
#include "worker/render/geometry/group_point.h"
#include "worker/render/geometry/raw_hit.h"
#include "worker/render/geometry/scene_geometry.h"
#include "worker/render/geometry/tangent_plane.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

struct SurfacePoint {
  Vec3f p;        // Space: render.
  Vec3f p_error;  // Bound of its absolute error, per component.
  Vec3f ng;       // Unit geometric normal, on the surface's own front side.
  Frame shading;  // n: unit shading normal, in the hemisphere of ng.
  Vec2f uv;       // For textures and hair; on curves along and across.
  const Surface* surface = nullptr;
  uint32_t emitter = kNoEmitter;
  PrimitiveId id;
  float contact = 0;  // As RawHit::contact.
  float reach = 0;    // On curves: the length of Ray::own_offset.
  VertexColor color;  // Set under Trait::kTextures.

  // The emitter's normal in the light table's convention: outward for spheres, whichever side is
  // the front.
  Vec3f EmitterNormal() const { return surface->is_sphere && surface->flips_normal ? -ng : ng; }
};

// Makes a ray towards w begin before the place p, by `contact` along its normal n. It moves along
// the ray, which thus meets the same edges; but only so far if it grazes the surface.
inline void BeginBefore(Vec3f p, Vec3f p_error, Vec3f n, float contact, Vec3f w, Ray* ray) {
  constexpr double kCosineMin = 1.0 / 16;
  const Vec3d d = Normalize(ToDouble(w));
  const double cosine = Dot(ToDouble(n), d);
  const double distance = static_cast<double>(contact + Dot(Abs(n), p_error));
  const double back = distance / std::max(std::fabs(cosine), kCosineMin);
  const double off = distance - back * std::fabs(cosine);
  ray->contact = contact;
  ray->o = ToFloat(ToDouble(p) - d * back - ToDouble(n) * (cosine < 0 ? -off : off));
  ray->lead = static_cast<float>(back);
}

// Makes the ray leave the point towards w. Sets all of it but the direction, the time and the end.
inline void Leave(const SurfacePoint& point, Vec3f w, Ray* ray) {
  ray->source = point.id;
  ray->contact = point.contact;
  ray->own_offset = point.ng * (Dot(point.ng, w) < 0 ? -point.reach : point.reach);
  if (point.contact > 0) [[unlikely]] {
    BeginBefore(point.p, point.p_error, point.ng, point.contact, w, ray);
  } else {
    ray->lead = 0;
    ray->o = OffsetRayOrigin(point.p, point.p_error, point.ng, w);
  }
}

namespace internal {

// The frame's x axis follows the mesh's own tangent or dpdu, if there is one.
inline Frame ShadingFrame(Vec3f ns, const TangentPlane& plane) {
  const Vec3d tangent = TangentOf(plane, ToDouble(ns));
  const double length = Length(tangent);
  if (!(length > 0) || !std::isfinite(length)) return Frame::FromNormal(ns);
  const Vec3f t = ToFloat(tangent * (1 / length));
  return {t, Cross(ns, t), ns};
}

// Relative to the mesh's first emitter.
template <TraitBits kTraits>
uint32_t EmitterOfFace(const Surface& surface, const RawHit& hit) {
  if constexpr (Has(kTraits, Trait::kTexturedEmission)) {
    const uint32_t cells = surface.emission_cells;
    return hit.id.primitive * cells * cells +
           CellAt(cells, static_cast<double>(hit.u), static_cast<double>(hit.v));
  }
  return hit.id.primitive;
}

// Computes the hit's point in its group, and point->surface and emitter. placement: null in the
// world.
// Inline, as is FinishPoint: compilers would call them, since instances are a second caller.
template <TraitBits kTraits>
[[gnu::always_inline]] inline GroupPoint PointOfHit(const GeometryGroup& group, const Ray& ray,
                                                    const RawHit& hit, const Placement* placement,
                                                    SurfacePoint* point) {
  const auto wants_parameters = [](const Surface& surface) {
    return surface.needs_tangent || surface.reads_textures;
  };
  const uint32_t quadrics = group.QuadricsId();
  if (!(Has(kTraits, Trait::kQuadrics) || Has(kTraits, Trait::kCurves)) ||
      hit.id.geometry < quadrics) {
    const BakedMesh& mesh = group.meshes[hit.id.geometry];
    point->surface = &mesh.surface;
    if (mesh.surface.emitter != kNoEmitter) {
      point->emitter = mesh.surface.emitter + EmitterOfFace<kTraits>(mesh.surface, hit);
    }
    if constexpr (Has(kTraits, Trait::kDeformation)) {
      if (!mesh.steps.empty()) {
        return DeformedTrianglePoint(mesh, hit, ray.time, wants_parameters(mesh.surface));
      }
    }
    return TrianglePoint(mesh, hit, wants_parameters(mesh.surface));
  }
  if (Has(kTraits, Trait::kCurves) && hit.id.geometry >= group.CurvesId(0)) {
    const BakedCurves& baked = group.curves[hit.id.geometry - group.CurvesId(0)];
    point->surface = &baked.surface;
    Vec3d d = ToDouble(ray.d);
    if (placement != nullptr) d = placement->group_from_render.Vector(d);
    GroupPoint on = PointOnCurve(baked, d, hit);
    if (placement != nullptr) {
      on.reach /= Length(placement->group_from_render.TransposedVector(on.ng));
    }
    return on;
  }
  if (hit.id.geometry > quadrics) {
    const BakedPatches& baked = group.patches[hit.id.geometry - group.PatchesId(0)];
    point->surface = &baked.surface;
    return PointOnPatch(baked, hit, wants_parameters(baked.surface));
  }
  const BakedQuadric& baked = group.quadrics[hit.id.primitive];
  point->surface = &baked.surface;
  point->emitter = baked.surface.emitter;
  Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  if (placement != nullptr) {
    o = placement->group_from_render.Point(o);
    d = placement->group_from_render.Vector(d);
  }
  return PointOnQuadric(baked, o, d, hit.t, wants_parameters(baked.surface));
}

// Completes the shading properties of `on`, which is in render space with error `rounding`.
template <TraitBits kTraits, typename Plane>
[[gnu::always_inline]] inline void FinishPoint(const GroupPoint& on, Vec3d rounding,
                                               SurfacePoint* point, [[maybe_unused]] Plane* plane) {
  point->p = ToFloat(on.p);
  point->p_error = Gamma(1) * render::Abs(point->p) + ToFloat(rounding);
  point->ng = ToFloat(on.ng);
  if constexpr (Has(kTraits, Trait::kCurves)) {
    point->reach = static_cast<float>(on.reach);
  }
  // Flat surfaces use exactly the bits of their geometric normal for shading.
  const Vec3f ns = on.ns == on.ng ? point->ng : ToFloat(on.ns * (1 / Length(on.ns)));
  if constexpr (Has(kTraits, Trait::kTextures) || Has(kTraits, Trait::kHair) ||
                Has(kTraits, Trait::kCurves)) {
    point->uv = on.uv;
  }
  if constexpr (Has(kTraits, Trait::kTextures)) point->color = on.color;
  const auto tangents = [&] {
    return TangentPlane{ToDouble(ns), on.dpdu, on.dpdv, on.has_tangents, on.own_tangent};
  };
  point->shading = point->surface->needs_tangent ? internal::ShadingFrame(ns, tangents())
                                                 : Frame::FromNormal(ns);
  if constexpr (std::is_same_v<Plane, std::optional<TangentPlane>>) {
    if (point->surface->has_normal_map) *plane = tangents();
  }
}

// Out of line, so that unplaced geometry, the common case, does not pay for it.
template <TraitBits kTraits, typename Plane>
[[gnu::noinline]] void MakePlacedPoint(const SceneGeometry& geometry, const Ray& ray,
                                       const RawHit& hit, Plane* plane, SurfacePoint* point) {
  const PlacedGroup& placed = PlacedAt(geometry, hit.id.placed);
  const Placement placement{RenderFromGroupAt(geometry, placed, ray.time),
                            GroupFromRenderAt(geometry, placed, ray.time)};
  point->id = hit.id;
  point->contact = hit.contact;
  GroupPoint on = PointOfHit<kTraits>(geometry.groups[placed.group], ray, hit, &placement, point);
  Vec3d rounding = ToDouble(on.coordinate_max) * kDoubleRounding;
  PlacePoint(placement, &on, &rounding);
  FinishPoint<kTraits>(on, rounding, point, plane);
}

}  // namespace internal

// Requires: hit is a hit of ray in the EmbreeScene of `geometry`. plane: a std::optional that
// receives the inputs of a normal map if the surface has one; any other type is ignored.
template <TraitBits kTraits, typename Plane = std::nullopt_t>
SurfacePoint MakeSurfacePoint(const SceneGeometry& geometry, const Ray& ray, const RawHit& hit,
                              [[maybe_unused]] Plane* plane = nullptr) {
  SurfacePoint point;  // Every return names it, so that no caller copies it.
  if constexpr (Has(kTraits, Trait::kInstances) || Has(kTraits, Trait::kMotion)) {
    if (hit.id.placed != kNotPlaced) [[unlikely]] {
      internal::MakePlacedPoint<kTraits>(geometry, ray, hit, plane, &point);
      return point;
    }
  }
  point.id = hit.id;
  point.contact = hit.contact;
  const internal::GroupPoint on =
      internal::PointOfHit<kTraits>(geometry.groups[0], ray, hit, nullptr, &point);
  internal::FinishPoint<kTraits>(on, ToDouble(on.coordinate_max) * internal::kDoubleRounding,
                                 &point, plane);
  return point;
}

}  // namespace sheaf::render
