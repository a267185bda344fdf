// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The one file that includes Embree: its types, and what differs between 3.13 and 4.x. For the
// embree_*.cc files alone; everybody else traces through embree_scene.h.
#pragma once

#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

#include "worker/render/accel/embree_scene.h"
#include "worker/render/geometry/ray_origin.h"

namespace sheaf::render {

#if RTC_VERSION_MAJOR >= 4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

// Embree's distances are made with approximate reciprocals, which processors of two makers round
// differently, by some 2^-22. So which hit is the nearest is decided by distances of ours, and
// Embree looks for hits a little beyond the nearest, to offer all that may be nearer.
inline constexpr float kDistanceDoubt = 0x1p-18f;
inline float SearchEnd(float t) { return t * (1 + kDistanceDoubt); }

// Embree hands its context on to callbacks; ours carries the primitive that the ray leaves, which
// placed group (or the world, kNotPlaced) is being traced, and the nearest hit so far.
struct TraceContext {
  QueryContext base;
  PrimitiveId source;
  uint32_t here = kNotPlaced;
  // The distance of the nearest hit, from the ray's end on; the greatest id where there is none.
  mutable float nearest;
  mutable PrimitiveId nearest_id;
  // Of a hit whose u and v are still Embree's; null where they are ours (Settle).
  mutable const BakedMesh* unsettled = nullptr;

  TraceContext(PrimitiveId ray_source, float t_max) : source(ray_source), nearest(t_max) { Init(); }
  // Of a ray that enters a placed group.
  TraceContext(const TraceContext& outside, uint32_t placed)
      : source(outside.source),
        here(placed),
        nearest(outside.nearest),
        nearest_id(outside.nearest_id) {
    Init();
  }

  // Embree writes nothing to it.
  QueryContext* Handed() const { return const_cast<QueryContext*>(&base); }
  bool IsSource(uint32_t geometry, uint32_t primitive) const {
    return PrimitiveId{geometry, primitive, here} == source;
  }
  // Takes a hit if it is the nearest. Of hits at one distance the one of the smallest id is,
  // whatever order they are found in.
  bool Take(float t, uint32_t geometry, uint32_t primitive) const {
    const PrimitiveId id{geometry, primitive, here};
    if (!(t < nearest || (t == nearest && id < nearest_id))) return false;
    nearest = t;
    nearest_id = id;
    unsettled = nullptr;
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
};

// Calls that changed their shape between the two versions.
inline void TraceNearest(RTCScene scene, const TraceContext* context, RTCRayHit* ray_hit) {
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
#if RTC_VERSION_MAJOR >= 4
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = context->Handed();
  rtcOccluded1(scene, ray, &arguments);
#else
  rtcOccluded1(scene, context->Handed(), ray);
#endif
}

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
  r.tfar = SearchEnd(ray.t_max);
  r.mask = ~0u;
  r.id = 0;
  r.flags = 0;
  return r;
}
inline void ClearHit(RTCHit* hit) {
  hit->geomID = RTC_INVALID_GEOMETRY_ID;
  hit->instID[0] = kNotPlaced;
}

}  // namespace sheaf::render
