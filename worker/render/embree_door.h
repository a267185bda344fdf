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

#include "worker/render/embree_scene.h"
#include "worker/render/ray_origin.h"

namespace sheaf::render {

#if RTC_VERSION_MAJOR >= 4
using QueryContext = RTCRayQueryContext;
#else
using QueryContext = RTCIntersectContext;
#endif

// Embree hands its context on to callbacks; ours carries the primitive that the ray leaves, and
// which placed group (or the world, kNotPlaced) is being traced.
struct SourceContext {
  QueryContext base;
  PrimitiveId source;
  uint32_t here;
  // The distance of the nearest hit accepted, from the ray's end on. Kept where filters may set a
  // hit back (needles): they are not told by Embree what it would then be behind.
  mutable float nearest;

  SourceContext(PrimitiveId ray_source, float t_max, uint32_t placed = kNotPlaced)
      : source(ray_source), here(placed), nearest(t_max) {
#if RTC_VERSION_MAJOR >= 4
    rtcInitRayQueryContext(&base);
#else
    rtcInitIntersectContext(&base);
#endif
  }
};

// Calls that changed their shape between the two versions.
inline void TraceNearest(RTCScene scene, SourceContext* context, RTCRayHit* ray_hit) {
#if RTC_VERSION_MAJOR >= 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.context = &context->base;
  rtcIntersect1(scene, ray_hit, &arguments);
#else
  rtcIntersect1(scene, &context->base, ray_hit);
#endif
}
inline void TraceAny(RTCScene scene, SourceContext* context, RTCRay* ray) {
#if RTC_VERSION_MAJOR >= 4
  RTCOccludedArguments arguments;
  rtcInitOccludedArguments(&arguments);
  arguments.context = &context->base;
  rtcOccluded1(scene, ray, &arguments);
#else
  rtcOccluded1(scene, &context->base, ray);
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
  r.tfar = ray.t_max;
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
