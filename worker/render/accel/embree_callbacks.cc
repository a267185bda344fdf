// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Callbacks of user geometry for Embree. For single rays, its N-wide records have the layout of the
// single ones.
#include "worker/render/accel/embree_callbacks.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "common/base/check.h"
#include "worker/render/geometry/bilinear_patch.h"
#include "worker/render/geometry/curve.h"
#include "worker/render/geometry/quadric_hit.h"

namespace sheaf::render {
namespace {

void SetBounds(RTCBounds* out, Vec3f lower, Vec3f upper) {
  out->lower_x = lower.x;
  out->lower_y = lower.y;
  out->lower_z = lower.z;
  out->upper_x = upper.x;
  out->upper_y = upper.y;
  out->upper_z = upper.z;
}

void BoundQuadric(const RTCBoundsFunctionArguments* args) {
  const auto& list = *static_cast<const QuadricList*>(args->geometryUserPtr);
  const std::array<Vec3f, 2> bounds = QuadricBounds((*list.quadrics)[args->primID].quadric);
  SetBounds(args->bounds_o, bounds[0], bounds[1]);
}
// Doubt of a hit of a shape that was intersected in double: its own coordinates, and the rounding
// of the distance. coordinate_max: bound of them.
float DoubtOf(const RTCRay& ray, float t, Vec3f coordinate_max) {
  const float length =
      std::sqrt(ray.dir_x * ray.dir_x + ray.dir_y * ray.dir_y + ray.dir_z * ray.dir_z);
  const float reach = coordinate_max.x + coordinate_max.y + coordinate_max.z;
  return kDistanceDoubt * t + kPlaneRounding * reach / length;
}
// Ends the search if the hit hides the ray's end.
bool Block(const TraceContext& context, const Surface& surface, const TracerHit& hit, float doubt,
           RTCRay* ray) {
  if (!context.Blocks(hit, doubt)) return false;
  context.EndsAtPassable(surface);
  ray->tfar = -std::numeric_limits<float>::infinity();
  return true;
}
// Accepts a hit of a shape that was intersected in double, if it is the nearest.
bool Accept(const TraceContext& context, const TracerHit& hit, float doubt, RTCRayHit* ray_hit) {
  if (!context.Take(hit, doubt)) return false;
  ray_hit->ray.tfar = context.SearchEndOf();
  ray_hit->hit.u = hit.u;
  ray_hit->hit.v = hit.v;
  ray_hit->hit.primID = hit.id.primitive;
  ray_hit->hit.geomID = hit.id.geometry;
  ray_hit->hit.instID[0] = kNotPlaced;
  return true;
}

// A ray that starts before the place it leaves (Ray::contact) may meet a curved shape there, and
// again later. Calls on_hit(t) for the hits in order, until it is true or none is left. find(from):
// the first at a distance beyond `from`.
template <typename Find, typename OnHit>
void ForHits(const TraceContext& context, const Find& find, const OnHit& on_hit) {
  constexpr int kHitsMax = 3;
  double from = 0;
  for (int i = 0; i < kHitsMax; ++i) {
    const auto found = find(from);
    if (!found.has_value()) return;
    if (on_hit(*found) || context.start == nullptr) return;
    from =
        std::max(static_cast<double>(found->t), from) * (1 + static_cast<double>(kDistanceDoubt)) +
        context.start->t * static_cast<double>(kDistanceDoubt);
  }
}
template <bool kMasked, typename OnHit>
void FindQuadricHits(const TraceContext& context, const QuadricList& list, uint32_t index,
                     const RTCRay& ray, const OnHit& on_hit) {
  const BakedQuadric& baked = (*list.quadrics)[index];
  if (kMasked && (baked.surface.seen_by & ray.mask) == 0) return;
  const Quadric& quadric = baked.quadric;
  const Vec3d o = Origin(ray), d = Direction(ray);
  const auto find = [&](double from) -> std::optional<TracerHit> {
    const double t = QuadricHit(quadric, o + d * from, d, static_cast<double>(ray.tfar) - from);
    if (!(t > 0)) return std::nullopt;
    return TracerHit{static_cast<float>(from + t), 0, 0, context.IdOf(list.geometry, index)};
  };
  ForHits(context, find, [&](const TracerHit& hit) {
    return on_hit(hit, DoubtOf(ray, hit.t, quadric.coordinate_max));
  });
}
template <bool kMasked>
void IntersectQuadricList(const RTCIntersectFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const QuadricList*>(args->geometryUserPtr);
  auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const TraceContext& context = ContextOf(args->context);
  FindQuadricHits<kMasked>(
      context, list, args->primID, ray_hit->ray,
      [&](const TracerHit& hit, float doubt) { return Accept(context, hit, doubt, ray_hit); });
}
template <bool kMasked>
void OccludeQuadricList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const QuadricList*>(args->geometryUserPtr);
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  const TraceContext& context = ContextOf(args->context);
  const Surface& surface = (*list.quadrics)[args->primID].surface;
  FindQuadricHits<kMasked>(
      context, list, args->primID, *ray,
      [&](const TracerHit& hit, float doubt) { return Block(context, surface, hit, doubt, ray); });
}

void BoundPatch(const RTCBoundsFunctionArguments* args) {
  const auto& list = *static_cast<const PatchList*>(args->geometryUserPtr);
  const std::array<Vec3f, 2> bounds = PatchBounds(list.patches->PatchAt(args->primID));
  SetBounds(args->bounds_o, bounds[0], bounds[1]);
}
// A ray cannot hit a flat patch that it leaves, but may hit a curved one again.
template <typename OnHit>
void FindPatchHits(const TraceContext& context, const PatchList& list, uint32_t index,
                   const RTCRay& ray, const OnHit& on_hit) {
  const BilinearPatch patch = list.patches->PatchAt(index);
  if (context.IsSource(list.geometry, index) && patch.IsFlat()) return;
  const Vec3d o = Origin(ray), d = Direction(ray);
  const auto find = [&](double from) -> std::optional<TracerHit> {
    const std::optional<PatchHit> hit =
        IntersectPatch(patch, o + d * from, d, static_cast<double>(ray.tfar) - from);
    if (!hit.has_value()) return std::nullopt;
    return TracerHit{static_cast<float>(from + static_cast<double>(hit->t)),
                     static_cast<float>(hit->u), static_cast<float>(hit->v),
                     context.IdOf(list.geometry, index)};
  };
  Vec3f coordinate_max;
  const std::array<Vec3f, 2> bounds = PatchBounds(patch);
  for (size_t i = 0; i < 3; ++i) {
    coordinate_max[i] = std::max(std::fabs(bounds[0][i]), std::fabs(bounds[1][i]));
  }
  ForHits(context, find,
          [&](const TracerHit& hit) { return on_hit(hit, DoubtOf(ray, hit.t, coordinate_max)); });
}
void IntersectPatchList(const RTCIntersectFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const PatchList*>(args->geometryUserPtr);
  auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const TraceContext& context = ContextOf(args->context);
  FindPatchHits(context, list, args->primID, ray_hit->ray, [&](const TracerHit& hit, float doubt) {
    return Accept(context, hit, doubt, ray_hit);
  });
}
void OccludePatchList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const PatchList*>(args->geometryUserPtr);
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  const TraceContext& context = ContextOf(args->context);
  FindPatchHits(context, list, args->primID, *ray, [&](const TracerHit& hit, float doubt) {
    return Block(context, list.patches->surface, hit, doubt, ray);
  });
}

void BoundCurve(const RTCBoundsFunctionArguments* args) {
  const BakedCurves& curves = *static_cast<const CurveList*>(args->geometryUserPtr)->curves;
  const CurvePiece& piece = curves.pieces[args->primID];
  const std::array<Vec3f, 2> bounds =
      CurveBounds(SegmentOf(curves.set, piece.segment), piece, curves.target_from_shape);
  SetBounds(args->bounds_o, bounds[0], bounds[1]);
}
// A ray may hit the curve that it leaves, but not near where it leaves it (Ray::own_offset).
std::optional<CurveHit> HitCurve(const TraceContext& context, const CurveList& list, uint32_t index,
                                 const RTCRay& ray, float t_max) {
  const BakedCurves& curves = *list.curves;
  Vec3d o = Origin(ray);
  const Vec3d d = Direction(ray);
  const PrimitiveId& source = context.ray.source;
  if (source.geometry == list.geometry && source.placed == context.here) {
    Vec3d offset = ToDouble(context.ray.own_offset);
    if (context.here != kNotPlaced) {
      const PlacedGroup& placed = PlacedAt(context.geometry, context.here);
      offset = GroupFromRenderAt(context.geometry, placed, ray.time).Vector(offset);
    }
    o = o + offset;
  }
  if (!MayIntersect(curves.rods[index], o, d)) return std::nullopt;
  const CurvePiece& piece = curves.pieces[index];
  return IntersectCurve(SegmentOf(curves.set, piece.segment), piece,
                        curves.shape_from_target.Point(o), curves.shape_from_target.Vector(d),
                        static_cast<double>(t_max));
}
void IntersectCurveList(const RTCIntersectFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const CurveList*>(args->geometryUserPtr);
  auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const TraceContext& context = ContextOf(args->context);
  const std::optional<CurveHit> hit =
      HitCurve(context, list, args->primID, ray_hit->ray, ray_hit->ray.tfar);
  if (!hit.has_value()) return;
  const TracerHit found{static_cast<float>(hit->t), static_cast<float>(hit->u),
                        static_cast<float>(hit->v), context.IdOf(list.geometry, args->primID)};
  Accept(context, found, 0, ray_hit);
}
void OccludeCurveList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const CurveList*>(args->geometryUserPtr);
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  const TraceContext& context = ContextOf(args->context);
  const std::optional<CurveHit> hit =
      HitCurve(context, list, args->primID, *ray, context.ray.t_max);
  if (!hit.has_value()) return;
  const TracerHit found{static_cast<float>(hit->t), 0, 0,
                        context.IdOf(list.geometry, args->primID)};
  Block(context, list.curves->surface, found, 0, ray);
}

void BoundPlaced(const RTCBoundsFunctionArguments* args) {
  const auto& list = *static_cast<const PlacedList*>(args->geometryUserPtr);
  const PlacedGroup& placed = (*list.placed)[args->primID];
  const PlacedBounds bounds = placed.motion == kNone
                                  ? BoundsOfStill(*list.geometry, placed)
                                  : BoundsOfMoving(*list.geometry, placed, args->timeStep);
  SetBounds(args->bounds_o, bounds.lower, bounds.upper);
}
// The ray in the group's space. The direction keeps its length, so t stays the same.
RTCRay RayInGroup(const PlacedList& list, const PlacedGroup& placed, const RTCRay& ray) {
  const Affine group_from_render = GroupFromRenderAt(*list.geometry, placed, ray.time);
  RTCRay inner = ray;
  const Vec3f o = ToFloat(group_from_render.Point(Origin(ray)));
  const Vec3f d = ToFloat(group_from_render.Vector(Direction(ray)));
  inner.org_x = o.x;
  inner.org_y = o.y;
  inner.org_z = o.z;
  inner.dir_x = d.x;
  inner.dir_y = d.y;
  inner.dir_z = d.z;
  return inner;
}
void IntersectPlacedList(const RTCIntersectFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const PlacedList*>(args->geometryUserPtr);
  auto* outer = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const PlacedGroup& placed = (*list.placed)[args->primID];
  RTCRayHit inner;
  inner.ray = RayInGroup(list, placed, outer->ray);
  ClearHit(&inner.hit);
  const TraceContext& outside = ContextOf(args->context);
  const TraceContext context(outside, list.first + args->primID);
  TraceNearest((*list.scenes)[placed.group], &context, &inner);
  outside.nearest.contact = context.nearest.contact;
  if (inner.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  Settle(context, &inner);
  outside.unsettled = nullptr;
  outside.passes_beside = context.passes_beside;
  outside.nearest = context.nearest;
  outside.nearest_doubt = context.nearest_doubt;
  outer->ray.tfar = inner.ray.tfar;
  outer->hit = inner.hit;
  outer->hit.instID[0] = list.first + args->primID;
}
void OccludePlacedList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const PlacedList*>(args->geometryUserPtr);
  auto* outer = reinterpret_cast<RTCRay*>(args->ray);
  const PlacedGroup& placed = (*list.placed)[args->primID];
  RTCRay inner = RayInGroup(list, placed, *outer);
  const TraceContext& outside = ContextOf(args->context);
  const TraceContext context(outside, list.first + args->primID);
  TraceAny((*list.scenes)[placed.group], &context, &inner);
  if (inner.tfar < 0) outer->tfar = -std::numeric_limits<float>::infinity();
  outside.is_undecided |= context.is_undecided;
  outside.met_passable |= context.met_passable;
}

// Sets up a user geometry of `count` primitives.
void SetCallbacks(RTCGeometry user, size_t count, void* list, RTCBoundsFunction bound,
                  RTCIntersectFunctionN intersect, RTCOccludedFunctionN occlude) {
  rtcSetGeometryUserPrimitiveCount(user, static_cast<unsigned>(count));
  rtcSetGeometryUserData(user, list);
  rtcSetGeometryBoundsFunction(user, bound, nullptr);
  rtcSetGeometryIntersectFunction(user, intersect);
  rtcSetGeometryOccludedFunction(user, occlude);
}

}  // namespace

void SetQuadrics(RTCGeometry user, QuadricList* list) {
  const bool masked = list->have_masks;
  SetCallbacks(user, list->quadrics->size(), list, BoundQuadric,
               masked ? IntersectQuadricList<true> : IntersectQuadricList<false>,
               masked ? OccludeQuadricList<true> : OccludeQuadricList<false>);
}

void SetPatches(RTCGeometry user, PatchList* list) {
  SetCallbacks(user, list->patches->size(), list, BoundPatch, IntersectPatchList, OccludePatchList);
}

void SetCurves(RTCGeometry user, CurveList* list) {
  SetCallbacks(user, list->curves->size(), list, BoundCurve, IntersectCurveList, OccludeCurveList);
}

void SetPlaced(RTCGeometry user, PlacedList* list) {
  SetCallbacks(user, list->placed->size(), list, BoundPlaced, IntersectPlacedList,
               OccludePlacedList);
  if (list->placed->front().motion != kNone) rtcSetGeometryTimeStepCount(user, kMotionStepCount);
}

}  // namespace sheaf::render
