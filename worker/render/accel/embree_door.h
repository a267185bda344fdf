// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The only file that includes Embree: its types, and the differences between 3.13 and 4.x. Only for
// the embree_*.cc files; all other code uses embree_scene.h.
#pragma once

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>

#include "worker/render/accel/embree_scene.h"
#include "worker/render/geometry/contact.h"
#include "worker/render/geometry/ray_origin.h"

namespace sheaf::render {

#if RTC_VERSION_MAJOR >= 4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

// Embree's distances use approximate reciprocals, which processors of two vendors round
// differently, by about 2^-22. Our own distances therefore decide which hit is nearest, and Embree
// searches slightly beyond the nearest hit, so that it offers every hit that may be nearer.
inline constexpr float kDistanceDoubt = 0x1p-18f;
inline float SearchEnd(float t) { return t * (1 + kDistanceDoubt); }

// The plane of an emitter on which a ray ends is known within a bound. Hits are compared with it in
// double up to this many bounds before the end, which covers rays that are inclined by more than
// 1/256 to it.
inline constexpr float kEndBounds = 256;

// A hit that a filter or callback offers. Its fields stay in registers: a RawHit is made of them
// only for comparisons in double, which are rare.
struct TracerHit {
  float t = 0, u = 0, v = 0;  // As RawHit's.
  PrimitiveId id;

  RawHit Raw() const { return {t, u, v, id}; }
};

// Whether some rays may pass through the surface unchanged: cut-outs, interfaces of media,
// boundaries that others hide, and what some kinds of rays do not see.
inline bool MayLetPass(const Surface& surface) {
  return surface.has_alpha || surface.may_pass || surface.rank != kNoRank || surface.invisible != 0;
}

// Triangles that a ray passes by, although the tracer's rounding keeps the ray (EmbreeScene).
struct PassedTriangles {
  static constexpr int kCountMax = 4;
  std::array<PrimitiveId, kCountMax> ids;
  int count = 0;

  bool Contains(PrimitiveId id) const {
    return std::find(ids.begin(), ids.begin() + count, id) != ids.begin() + count;
  }
};

// Embree passes its context to callbacks; ours adds the ray, the placed group that is being traced
// (kNotPlaced for the world), and the nearest hit so far.
struct TraceContext {
  QueryContext base;
  const SceneGeometry& geometry;
  const Ray& ray;  // Space: render, in the world as well as in groups.
  // The contact that the ray leaves, if other surfaces may lie at its place (Ray::contact), and the
  // doubt of its distance, in lengths of the direction.
  const Contact* start = nullptr;
  double start_doubt = 0;
  const PassedTriangles* passed = nullptr;  // Null: none.
  uint32_t here = kNotPlaced;
  // Initially the ray's end, without an id. nearest.contact may grow after the hit was taken.
  mutable RawHit nearest;
  mutable float nearest_doubt = 0;  // Initially that of the ray's end.
  // The mesh of a hit whose u and v are still Embree's; null where they are ours (Settle).
  mutable const BakedMesh* unsettled = nullptr;
  // The ray passes beside the triangle of the nearest hit, within the tracer's rounding; before
  // Settle it may.
  mutable bool passes_beside = false;
  // The search ends at the first hit, also of a surface that may let the ray pass.
  bool ends_at_passable = false;
  mutable bool met_passable = false;  // It has ended there.
  // A triangle may hide the ray's end, but the ray passes so near to an edge that the search for
  // the nearest hit must decide.
  mutable bool is_undecided = false;

  // plane_bound: of the distance of any emitter's plane from the one that is meant.
  TraceContext(const SceneGeometry& scene, float plane_bound, const Ray& traced,
               const Contact* left, const PassedTriangles* passed_by = nullptr)
      : geometry(scene), ray(traced), start(left), passed(passed_by) {
    nearest.t = ray.t_max;
    if (ray.end == Ray::End::kEmitter) nearest_doubt = kEndBounds * plane_bound / Length(ray.d);
    if (left != nullptr) [[unlikely]]
      start_doubt = left->doubt / std::fabs(Dot(left->n, ToDouble(ray.d)));
    Init();
  }
  // For a ray that enters a placed group.
  TraceContext(const TraceContext& outside, uint32_t placed)
      : geometry(outside.geometry),
        ray(outside.ray),
        start(outside.start),
        start_doubt(outside.start_doubt),
        passed(outside.passed),
        here(placed),
        nearest(outside.nearest),
        nearest_doubt(outside.nearest_doubt),
        ends_at_passable(outside.ends_at_passable) {
    Init();
  }

  // Embree does not write to it.
  QueryContext* Handed() const { return const_cast<QueryContext*>(&base); }
  PrimitiveId IdOf(uint32_t id_of_geometry, uint32_t primitive) const {
    return {id_of_geometry, primitive, here};
  }
  bool IsSource(uint32_t id_of_geometry, uint32_t primitive) const {
    return IdOf(id_of_geometry, primitive) == ray.source;
  }
  bool IsPassedBy(uint32_t id_of_geometry, uint32_t primitive) const {
    return passed != nullptr && passed->Contains(IdOf(id_of_geometry, primitive));
  }
  // Whether the primitive is the emitter on which the ray ends; false for one of its cells.
  bool IsEnd(const Surface& surface, uint32_t primitive) const {
    return ray.end == Ray::End::kEmitter && surface.emitter != kNoEmitter &&
           surface.emission_cells == 1 && ray.end_emitter - surface.emitter == primitive;
  }
  // Embree searches up to here for hits that may be nearer than the nearest, or at its place.
  float SearchEndOf() const { return SearchEnd(nearest.t) + nearest_doubt; }

  // Accepts a hit if it is the nearest. Among hits at the same distance the smallest id wins, in
  // whatever order they are found. doubt: bound of the error of hit.t and of that of its plane, in
  // lengths of the direction; distances that it cannot tell apart are compared in double.
  bool Take(const TracerHit& hit, float doubt) const {
    if (start != nullptr && !IsAfterStart(hit.Raw(), doubt)) [[unlikely]]
      return false;
    if (std::fabs(hit.t - nearest.t) <= doubt + nearest_doubt) [[unlikely]] {
      if (!IsNearest(hit.Raw())) return false;
    } else if (hit.t < nearest.t) {
      nearest.contact = 0;
    } else {
      return false;
    }
    nearest.t = hit.t;
    nearest.u = hit.u;
    nearest.v = hit.v;
    nearest.id = hit.id;
    nearest_doubt = doubt;
    unsettled = nullptr;
    passes_beside = false;
    return true;
  }
  // Whether the hit hides the ray's end.
  bool Blocks(const TracerHit& hit, float doubt) const {
    if (start != nullptr && !IsAfterStart(hit.Raw(), doubt)) [[unlikely]]
      return false;
    if (std::fabs(hit.t - ray.t_max) <= doubt + nearest_doubt) return IsBeforeEnd(hit.Raw());
    return hit.t < ray.t_max;
  }

  // Whether a hit of the surface ends the search without telling whether it hides the ray's end.
  bool EndsAtPassable(const Surface& surface) const {
    if (!ends_at_passable || !MayLetPass(surface)) return false;
    met_passable = true;
    return true;
  }

 private:
  void Init() {
#if RTC_VERSION_MAJOR >= 4
    rtcInitRayQueryContext(&base);
#else
    rtcInitIntersectContext(&base);
#endif
  }
  // The comparisons where rounding may decide (trace_context.cc).
  bool IsAfterStart(const RawHit& hit, float doubt) const;
  bool IsNearest(const RawHit& hit) const;
  // Sets nearest.contact.
  bool IsBeforeEnd(const RawHit& hit) const;
};

// False for a ray that Embree does not accept: it is so far from all that rays meet, or these are
// so small beside it, that it meets nothing; or it is not a number.
inline bool IsTraceable(const RTCRay& ray) {
  const auto is_in_range = [](float x) { return std::fabs(x) <= kTracedMax; };
  return is_in_range(ray.org_x) & is_in_range(ray.org_y) & is_in_range(ray.org_z) &
         is_in_range(ray.dir_x) & is_in_range(ray.dir_y) & is_in_range(ray.dir_z);
}

// Calls whose signature differs between the two versions.
inline void TraceNearest(RTCScene scene, const TraceContext* context, RTCRayHit* ray_hit) {
  if (!IsTraceable(ray_hit->ray)) return;
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = context->Handed();
  rtcIntersect1(scene, ray_hit, &arguments);
#else
  rtcIntersect1(scene, context->Handed(), ray_hit);
#endif
}
inline void TraceAny(RTCScene scene, const TraceContext* context, RTCRay* ray) {
  if (!IsTraceable(*ray)) return;
#if RTC_VERSION_MAJOR >= 4
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = context->Handed();
  rtcOccluded1(scene, ray, &arguments);
#else
  rtcOccluded1(scene, context->Handed(), ray);
#endif
}

inline Vec3d Origin(const RTCRay& r) { return {r.org_x, r.org_y, r.org_z}; }
inline Vec3d Direction(const RTCRay& r) { return {r.dir_x, r.dir_y, r.dir_z}; }

inline const TraceContext& ContextOf(const QueryContext* context) {
  return *reinterpret_cast<const TraceContext*>(context);
}

// Without its end.
inline RTCRay ToRtc(const Ray& ray) {
  RTCRay r;
  r.org_x = ray.o.x;
  r.org_y = ray.o.y;
  r.org_z = ray.o.z;
  r.tnear = 0;
  r.dir_x = ray.d.x;
  r.dir_y = ray.d.y;
  r.dir_z = ray.d.z;
  r.time = ray.time;
  r.mask = ray.mask;
  r.id = 0;
  r.flags = 0;
  return r;
}
inline void ClearHit(RTCHit* hit) {
  hit->geomID = RTC_INVALID_GEOMETRY_ID;
  hit->instID[0] = kNotPlaced;
}

}  // namespace sheaf::render
