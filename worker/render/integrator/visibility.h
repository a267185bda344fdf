// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Visibility: shadow rays, and null interfaces, the surfaces that rays pass through unchanged
// (cut-outs, interface materials, and mixes that turn into one).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "common/math/mix_bits.h"
#include "worker/render/accel/embree_scene.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/integrator/context.h"

namespace sheaf::render {

// The uniform numbers that decide at a surface that may be a null interface; independent for each
// crossing.
struct NullInterfaceChoice {
  float cut_out, mix;
};
// u: the numbers of the segment's slot. crossing: number of surfaces crossed on the segment before.
inline NullInterfaceChoice MakeNullInterfaceChoice(std::array<float, 2> u, uint32_t crossing) {
  if (crossing == 0) return {u[0], u[1]};
  // Later surfaces of the same segment must decide independently: hash the slot's numbers.
  uint64_t state = (uint64_t{std::bit_cast<uint32_t>(u[0])} << 32) | std::bit_cast<uint32_t>(u[1]);
  state += uint64_t{crossing} * 0x9e3779b97f4a7c15u;
  state = MixBits(state);
  return {static_cast<float>(state >> 40) * 0x1p-24f,
          static_cast<float>((state >> 8) & 0xffffff) * 0x1p-24f};
}
// The choice for the surface that the path's ray hits.
template <typename C>
NullInterfaceChoice NullInterfaceChoiceAt(const Context<C>& c, const Surface& surface,
                                          const PathState<C>& path) {
  if (!C::kNullInterfaces || (!surface.has_alpha && !surface.may_pass)) return {};
  const Vec2f u = c.sampler.Get2(Slot(NextVertexIndex(path), VertexSlot::kSurface));
  return MakeNullInterfaceChoice({u.x, u.y}, path.null_crossings);
}

template <typename C>
TexturePoint TexturePointOf(const Context<C>& c, const SurfacePoint& point) {
  TexturePoint texture_point;
  if constexpr (C::Has(Trait::kHair)) texture_point.uv = point.uv;
  if constexpr (C::Has(Trait::kTextures)) {
    texture_point.uv = point.uv;
    if (point.surface->reads_textures) {
      texture_point.color = point.color;
      texture_point.ng = point.ng;
      texture_point.p_world = ToDouble(point.p) + c.scene.geometry.render_origin_world;
    }
  }
  return texture_point;
}

template <typename C>
bool IsCutOut(const Context<C>& c, const SurfacePoint& point, float u) {
  if constexpr (C::kNullInterfaces) {
    if (!point.surface->has_alpha) return false;
    const ShapeDescription& shape = c.scene.description.shapes[point.surface->shape];
    return u >= c.scene.materials->template EvaluateFloat<C::kTraits>(shape.alpha,
                                                                      TexturePointOf(c, point));
  }
  return false;
}

// Whether a shadow ray passes through the surface.
template <typename C>
bool IsNullInterface(const Context<C>& c, const SurfacePoint& point, NullInterfaceChoice choice) {
  const Surface& surface = *point.surface;
  if (!surface.has_alpha && !surface.may_pass) return false;
  if (IsCutOut(c, point, choice.cut_out)) return true;
  const Bsdf bsdf = c.scene.materials->template Evaluate<C::kRgbTraits>(
      surface.material, TexturePointOf(c, point), choice.mix);
  return bsdf.kind == BsdfKind::kInterface;
}

// The fraction of a light with a cut-out that is left at the sampled point.
template <typename C>
float CutOutTransmittance(const Context<C>& c, const LightSampleOf<typename C::Color>& light) {
  const ShapeDescription& shape = c.scene.description.shapes[light.cut_out];
  TexturePoint there{light.uv, ToDouble(light.p_light) + c.scene.geometry.render_origin_world};
  there.ng = light.n_light;
  const float left = c.scene.materials->template EvaluateFloat<C::kTraits>(shape.alpha, there);
  return std::min(1.0f, std::max(0.0f, left));
}

// Scales the radiance of a sampled light by its cut-out.
template <typename C>
void ApplyCutOut([[maybe_unused]] const Context<C>& c,
                 [[maybe_unused]] LightSampleOf<typename C::Color>* light) {
  if constexpr (C::kNullInterfaces && C::Has(Trait::kTexturedEmission)) {
    if (light->cut_out != kNone) light->radiance *= CutOutTransmittance(c, *light);
  }
}

// The ray from the point to the light. Sets *end for lights at a finite distance.
template <typename Color>
Ray ShadowRay(const SurfacePoint& point, const LightSampleOf<Color>& light, float time,
              Vec3f* end) {
  Ray ray;
  ray.time = time;
  Leave(point, light.wi, &ray);
  ray.d = light.wi;
  if (!light.is_infinite) {
    *end = OffsetRayOrigin(light.p_light, light.p_light_error, light.n_light, -light.wi);
    ray.d = *end - ray.o;
    ray.t_max = 1;
    ray.end = Ray::End::kEmitter;
    ray.end_emitter = light.light;
  }
  return ray;
}

// end: null for lights at infinity. u: the numbers of the light's slot.
template <typename C>
bool IsVisibleThroughNullInterfaces(const Context<C>& c, Ray ray, const Vec3f* end,
                                    std::array<float, 2> u) {
  for (uint32_t crossing = 0; crossing < kNullCrossingsMax; ++crossing) {
    ++c.counts.rays;
    ++c.counts.shadow_rays;
    // Most rays meet no surface that lets them pass, and need no nearest hit.
    if (crossing == 0) {
      const Passage passage = c.tracer.PassageOf(ray);
      if (passage != Passage::kUnknown) return passage == Passage::kOpen;
    }
    RawHit hit;
    if (!c.tracer.Intersect(ray, &hit)) return true;
    const SurfacePoint point = MakeSurfacePoint<C::kTraits>(c.scene.geometry, ray, hit);
    // From 1 on: the slot's own numbers have been used to choose the light.
    if (!IsNullInterface(c, point, MakeNullInterfaceChoice(u, crossing + 1))) return false;
    Leave(point, ray.d, &ray);
    if (end != nullptr) ray.d = *end - ray.o;
  }
  ++c.counts.long_segments;
  return false;
}

// Visibility of the light from the point, for configurations without media.
template <typename C>
bool IsVisible(const Context<C>& c, const SurfacePoint& point,
               const LightSampleOf<typename C::Color>& light, std::array<float, 2> u, float time) {
  Vec3f end{};
  Ray ray = ShadowRay(point, light, time, &end);
  if constexpr (C::kRayKinds) ray.mask = BitOf(RayKind::kShadow);
  if constexpr (C::kNullInterfaces) {
    return IsVisibleThroughNullInterfaces(c, ray, light.is_infinite ? nullptr : &end, u);
  } else {
    ++c.counts.rays;
    ++c.counts.shadow_rays;
    return !c.tracer.Occluded(ray);
  }
}

}  // namespace sheaf::render
