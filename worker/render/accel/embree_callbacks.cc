// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Callbacks for Embree. For single rays, its N-wide records have the layout of the single ones.
#include "worker/render/accel/embree_callbacks.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "common/base/check.h"
#include "worker/render/geometry/bilinear_patch.h"
#include "worker/render/geometry/curve.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/needle.h"

namespace sheaf::render {
namespace {

Vec3d Origin(const RTCRay& r) { return {r.org_x, r.org_y, r.org_z}; }
Vec3d Direction(const RTCRay& r) { return {r.dir_x, r.dir_y, r.dir_z}; }

const TraceContext& ContextOf(const QueryContext* context) {
  return *reinterpret_cast<const TraceContext*>(context);
}

// A hit that Embree found and a filter checks. While filters run, the ray ends at the hit.
struct Candidate {
  const TraceContext& context;
  const BakedMesh& mesh;
  RTCRay& ray;
  RTCHit& hit;

  explicit Candidate(const RTCFilterFunctionNArguments* args)
      : context(ContextOf(args->context)),
        mesh(*static_cast<const BakedMesh*>(args->geometryUserPtr)),
        ray(*reinterpret_cast<RTCRay*>(args->ray)),
        hit(*reinterpret_cast<RTCHit*>(args->hit)) {}

  bool IsSource() const { return context.IsSource(hit.geomID, hit.primID); }
  const uint32_t* Indices() const { return &mesh.indices[3 * static_cast<size_t>(hit.primID)]; }
  // The distance to the triangle's plane, as Embree has it before its division.
  float PlaneDistance() const {
    const Vec3f corner = mesh.positions[Indices()[0]];
    return TimesNormal(corner.x - ray.org_x, corner.y - ray.org_y, corner.z - ray.org_z) /
           TimesNormal(ray.dir_x, ray.dir_y, ray.dir_z);
  }
  float TimesNormal(float x, float y, float z) const {
    return std::fma(x, hit.Ng_x, std::fma(y, hit.Ng_y, z * hit.Ng_z));
  }
  bool Take(float t) const {
    if (!context.Take(t, hit.geomID, hit.primID)) return false;
    ray.tfar = SearchEnd(t);
    return true;
  }
};

// For a mesh without needles Embree decides which hits exist; we compute their distance.
void JudgeNearest(const RTCFilterFunctionNArguments* args) {
  const Candidate candidate(args);
  args->valid[0] = 0;
  if (candidate.IsSource() || !candidate.Take(candidate.PlaneDistance())) return;
  args->valid[0] = -1;
  candidate.context.unsettled = &candidate.mesh;
}
void JudgeAny(const RTCFilterFunctionNArguments* args) {
  const Candidate candidate(args);
  const float end = candidate.context.nearest;
  const bool is_clear = candidate.ray.tfar <= end * (1 - kDistanceDoubt);
  const bool is_in_the_way =
      !candidate.IsSource() && (is_clear || candidate.PlaneDistance() <= end);
  if (!is_in_the_way) args->valid[0] = 0;
}
// Recomputes a hit in double, or rejects it. The result may be farther than Embree's, up to the
// last accepted hit. find_hit: intersects the ray with a triangle of the mesh (three indices).
template <typename FindHit>
void TestAgain(const RTCFilterFunctionNArguments* args, const FindHit& find_hit) {
  const Candidate candidate(args);
  args->valid[0] = 0;
  if (candidate.IsSource()) return;
  const std::optional<TriangleHit> found =
      find_hit(candidate.mesh, candidate.Indices(), candidate.ray);
  const float t = found.has_value() ? static_cast<float>(found->t) : 0;
  if (!(t > 0) || !candidate.Take(t)) return;
  args->valid[0] = -1;
  candidate.hit.u = static_cast<float>(found->u);
  candidate.hit.v = static_cast<float>(found->v);
}
void TestNeedleAgain(const RTCFilterFunctionNArguments* args) {
  TestAgain(args, [](const BakedMesh& mesh, const uint32_t* t, const RTCRay& ray) {
    return IntersectTriangle(Origin(ray), Direction(ray),
                             {ToDouble(mesh.positions[t[0]]), ToDouble(mesh.positions[t[1]]),
                              ToDouble(mesh.positions[t[2]])});
  });
}
void TestDeformedAgain(const RTCFilterFunctionNArguments* args) {
  TestAgain(args,
            [](const BakedMesh& mesh, const uint32_t* t,
               const RTCRay& ray) -> std::optional<TriangleHit> {
              const DeformedTriangle triangle =
                  DeformedTriangleAt(mesh, t, VertexTimeAt(mesh, ray.time));
              const auto& [a, b, c] = triangle.corners;
              // At this time the triangle may be degenerate.
              if (!(LengthSquared(Cross(b - a, c - a)) > 0)) return std::nullopt;
              return IntersectTriangle(Origin(ray), Direction(ray), triangle.corners,
                                       CornerErrorOf(mesh, triangle));
            });
}

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
// Accepts a hit of a shape that was intersected in double, if it is the nearest.
void Accept(const TraceContext& context, PrimitiveId id, double t, float u, float v,
            RTCRayHit* ray_hit) {
  const auto distance = static_cast<float>(t);
  if (!context.Take(distance, id.geometry, id.primitive)) return;
  ray_hit->ray.tfar = SearchEnd(distance);
  ray_hit->hit.u = u;
  ray_hit->hit.v = v;
  ray_hit->hit.primID = id.primitive;
  ray_hit->hit.geomID = id.geometry;
  ray_hit->hit.instID[0] = kNotPlaced;
}
void IntersectQuadricList(const RTCIntersectFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const QuadricList*>(args->geometryUserPtr);
  auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const Quadric& quadric = (*list.quadrics)[args->primID].quadric;
  const std::optional<double> t =
      IntersectQuadric(quadric, Origin(ray_hit->ray), Direction(ray_hit->ray), ray_hit->ray.tfar);
  if (!t.has_value()) return;
  Accept(ContextOf(args->context), {list.geometry, args->primID}, *t, 0, 0, ray_hit);
}
void OccludeQuadricList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const QuadricList*>(args->geometryUserPtr);
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  const Quadric& quadric = (*list.quadrics)[args->primID].quadric;
  const float end = ContextOf(args->context).nearest;
  if (IntersectQuadric(quadric, Origin(*ray), Direction(*ray), end).has_value()) {
    ray->tfar = -std::numeric_limits<float>::infinity();
  }
}

void BoundPatch(const RTCBoundsFunctionArguments* args) {
  const auto& list = *static_cast<const PatchList*>(args->geometryUserPtr);
  const std::array<Vec3f, 2> bounds = PatchBounds(list.patches->PatchAt(args->primID));
  SetBounds(args->bounds_o, bounds[0], bounds[1]);
}
// A ray cannot hit a flat patch that it leaves, but may hit a curved one again.
std::optional<PatchHit> HitPatch(const PatchList& list, uint32_t index, const RTCRay& ray,
                                 const TraceContext& context, float t_max) {
  const BilinearPatch patch = list.patches->PatchAt(index);
  if (context.IsSource(list.geometry, index) && patch.IsFlat()) return std::nullopt;
  return IntersectPatch(patch, Origin(ray), Direction(ray), t_max);
}
void IntersectPatchList(const RTCIntersectFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const PatchList*>(args->geometryUserPtr);
  auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const TraceContext& context = ContextOf(args->context);
  const std::optional<PatchHit> hit =
      HitPatch(list, args->primID, ray_hit->ray, context, ray_hit->ray.tfar);
  if (!hit.has_value()) return;
  Accept(context, {list.geometry, args->primID}, hit->t, static_cast<float>(hit->u),
         static_cast<float>(hit->v), ray_hit);
}
void OccludePatchList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const PatchList*>(args->geometryUserPtr);
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  const TraceContext& context = ContextOf(args->context);
  if (HitPatch(list, args->primID, *ray, context, context.nearest).has_value()) {
    ray->tfar = -std::numeric_limits<float>::infinity();
  }
}

void BoundCurve(const RTCBoundsFunctionArguments* args) {
  const BakedCurves& curves = *static_cast<const CurveList*>(args->geometryUserPtr)->curves;
  const CurvePiece& piece = curves.pieces[args->primID];
  const std::array<Vec3f, 2> bounds =
      CurveBounds(SegmentOf(curves.set, piece.segment), piece, curves.target_from_shape);
  SetBounds(args->bounds_o, bounds[0], bounds[1]);
}
// A ray may hit the curve that it leaves: its origin is offset by more than the width.
std::optional<CurveHit> HitCurve(const BakedCurves& curves, uint32_t index, const RTCRay& ray,
                                 float t_max) {
  const Vec3d o = Origin(ray), d = Direction(ray);
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
  const std::optional<CurveHit> hit =
      HitCurve(*list.curves, args->primID, ray_hit->ray, ray_hit->ray.tfar);
  if (!hit.has_value()) return;
  Accept(ContextOf(args->context), {list.geometry, args->primID}, hit->t,
         static_cast<float>(hit->u), static_cast<float>(hit->v), ray_hit);
}
void OccludeCurveList(const RTCOccludedFunctionNArguments* args) {
  SHEAF_DCHECK(args->N == 1);
  if (args->valid[0] == 0) return;
  const auto& list = *static_cast<const CurveList*>(args->geometryUserPtr);
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  const float end = ContextOf(args->context).nearest;
  if (HitCurve(*list.curves, args->primID, *ray, end).has_value()) {
    ray->tfar = -std::numeric_limits<float>::infinity();
  }
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
  if (inner.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  Settle(context, &inner);
  outside.unsettled = nullptr;
  outside.nearest = context.nearest;
  outside.nearest_id = context.nearest_id;
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
  const TraceContext context(ContextOf(args->context), list.first + args->primID);
  TraceAny((*list.scenes)[placed.group], &context, &inner);
  if (inner.tfar < 0) outer->tfar = -std::numeric_limits<float>::infinity();
}

}  // namespace

void Settle(const TraceContext& context, RTCRayHit* ray_hit) {
  if (context.unsettled == nullptr) return;
  const BakedMesh& mesh = *context.unsettled;
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(ray_hit->hit.primID)];
  const std::array<double, 3> weights =
      CornerWeights(Origin(ray_hit->ray), Direction(ray_hit->ray),
                    {ToDouble(mesh.positions[t[0]]), ToDouble(mesh.positions[t[1]]),
                     ToDouble(mesh.positions[t[2]])});
  ray_hit->hit.u = static_cast<float>(weights[1]);
  ray_hit->hit.v = static_cast<float>(weights[2]);
}

void FilterTriangles(RTCGeometry triangles, const BakedMesh& mesh, bool has_needles) {
  rtcSetGeometryUserData(triangles, const_cast<BakedMesh*>(&mesh));
  rtcSetGeometryIntersectFilterFunction(triangles, has_needles ? TestNeedleAgain : JudgeNearest);
  rtcSetGeometryOccludedFilterFunction(triangles, has_needles ? TestNeedleAgain : JudgeAny);
}

void FilterDeforming(RTCGeometry triangles, const BakedMesh& mesh) {
  rtcSetGeometryUserData(triangles, const_cast<BakedMesh*>(&mesh));
  rtcSetGeometryIntersectFilterFunction(triangles, TestDeformedAgain);
  rtcSetGeometryOccludedFilterFunction(triangles, TestDeformedAgain);
}

namespace {

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
  SetCallbacks(user, list->quadrics->size(), list, BoundQuadric, IntersectQuadricList,
               OccludeQuadricList);
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
