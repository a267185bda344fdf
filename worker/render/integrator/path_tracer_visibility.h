// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, what lies between two points: shadow rays, and surfaces that let rays pass. Included
// by path_tracer.h.
#pragma once

#include <array>
#include <bit>

#include "common/math/mix_bits.h"
#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::PassChoice
PathTracer<kTraits, Tracer, kDirectLight>::MakeChoice(std::array<float, 2> u, uint32_t pass) {
  if (pass == 0) return {u[0], u[1]};
  // Later surfaces of the same segment must decide independently: hash the slot's numbers.
  uint64_t state = (uint64_t{std::bit_cast<uint32_t>(u[0])} << 32) | std::bit_cast<uint32_t>(u[1]);
  state += uint64_t{pass} * 0x9e3779b97f4a7c15u;
  state = MixBits(state);
  return {static_cast<float>(state >> 40) * 0x1p-24f,
          static_cast<float>((state >> 8) & 0xffffff) * 0x1p-24f};
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::IsCutOut(const SurfacePoint& point, float u) const {
  if constexpr (kMayPass) {
    if (!point.surface->has_alpha) return false;
    const ShapeDescription& shape = scene_.description.shapes[point.surface->shape];
    return u >=
           scene_.materials->template EvaluateFloat<kTraits>(shape.alpha, TexturePointOf(point));
  }
  return false;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::LetsPass(const SurfacePoint& point,
                                                         PassChoice choice) const {
  const Surface& surface = *point.surface;
  if (!surface.has_alpha && !surface.may_pass) return false;
  if (IsCutOut(point, choice.cut_out)) return true;
  const Bsdf bsdf = scene_.materials->template Evaluate<kRgbTraits>(
      surface.material, TexturePointOf(point), choice.mix);
  return bsdf.kind == BsdfKind::kInterface;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
Ray PathTracer<kTraits, Tracer, kDirectLight>::ShadowRay(const SurfacePoint& point,
                                                         const LightSampleOf<Color>& light,
                                                         float time, Vec3f* end) {
  Ray ray;
  ray.time = time;
  ray.source = point.id;
  ray.o = OffsetRayOrigin(point.p, point.p_error, point.ng, light.wi);
  ray.d = light.wi;
  if (!light.is_infinite) {
    *end = OffsetRayOrigin(light.p_light, light.p_light_error, light.n_light, -light.wi);
    ray.d = *end - ray.o;
    ray.t_max = kSegmentEnd;
  }
  return ray;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::IsVisible(const SurfacePoint& point,
                                                          const LightSampleOf<Color>& light,
                                                          std::array<float, 2> u_pass, float time) {
  Vec3f end{};
  const Ray ray = ShadowRay(point, light, time, &end);
  if constexpr (kMayPass) return IsVisibleThroughCutOuts(ray, light.is_infinite, end, u_pass);
  ++counts_.rays;
  ++counts_.shadow_rays;
  return !tracer_.Occluded(ray);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::IsVisibleThroughCutOuts(
    Ray ray, bool is_infinite, Vec3f end, std::array<float, 2> u_pass) {
  for (uint32_t pass = 0; pass < kPassesMax; ++pass) {
    ++counts_.rays;
    ++counts_.shadow_rays;
    RawHit hit;
    if (!tracer_.Intersect(ray, &hit)) return true;
    const SurfacePoint point = MakeSurfacePoint<kTraits>(scene_.geometry, ray, hit);
    // Pass numbers from 1 on: the slot's own numbers have been used to choose the light.
    if (!LetsPass(point, MakeChoice(u_pass, pass + 1))) return false;
    ray.o = OffsetRayOrigin(point.p, point.p_error, point.ng, ray.d);
    ray.source = point.id;
    if (!is_infinite) ray.d = end - ray.o;
  }
  return false;
}

}  // namespace sheaf::render
