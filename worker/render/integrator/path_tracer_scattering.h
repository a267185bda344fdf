// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, the part at a surface: the normal that maps leave it, light from lamps, and where the
// path goes on. Included by path_tracer.h.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Tilt
PathTracer<kTraits, Tracer, kDirectLight>::MapNormal(const Sampler& sampler,
                                                     const TangentPlane& plane, float u_mix,
                                                     uint32_t depth, Vec3f wo,
                                                     SurfacePoint* point) const {
  TangentPlane seen = plane;
  seen.n = ToDouble(point->shading.n);
  const Vec3f mapped = scene_.materials->ShadingNormal(point->surface->material,
                                                       TexturePointOf(*point), u_mix, seen);
  const Vec3f n = BendNormal(LiftNormal(mapped, point->ng), point->ng, wo);
  point->shading = internal::ShadingFrame(n, seen);
  if (n == point->ng) return {};
  const std::array<float, 4> u = sampler.Get4(Slot(depth, VertexSlot::kSurface));
  return {point->shading.ToLocal(point->ng), {u[2], u[3]}};
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
inline BsdfValueOf<typename PathTracer<kTraits, Tracer, kDirectLight>::Color>
PathTracer<kTraits, Tracer, kDirectLight>::ValueTowards(Vec3f w, const SurfacePoint& point,
                                                        const Tilt& tilt, const BsdfOf<Color>& bsdf,
                                                        Vec3f wo_local) {
  const Vec3f wi_local = point.shading.ToLocal(w);
  if (!AgreesOnSide(bsdf, tilt, wi_local.z, Dot(w, point.ng))) return {};
  if constexpr (kMapsNormals) {
    if (tilt.active()) return tilt.template Eval<kTraits>(bsdf, wo_local, wi_local);
  }
  return EvalBsdf<kTraits>(bsdf, wo_local, wi_local);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::AddDirect(const LightDraw& draw,
                                                          const SurfacePoint& point,
                                                          const Tilt& tilt,
                                                          const BsdfOf<Color>& bsdf, Vec3f wo_local,
                                                          Vec3f light_hint, Path* path) {
  if (scene_.lights->empty()) return;
  const std::array<float, 4>& u = draw.u;
  std::optional<LightSampleOf<Color>> light = scene_.lights->template Sample<kTraits>(
      point.p, light_hint, u[2], {u[0], u[1]}, path->wavelengths, draw.preparation);
  if (!light.has_value()) return;
  const BsdfValueOf<Color> value = ValueTowards(light->wi, point, tilt, bsdf, wo_local);
  if (value.f_cos.IsBlack()) return;
  if constexpr (kMayPass && Has(kTraits, Trait::kVaryingEmission)) {
    if (light->cut_out != kNone) light->radiance *= ShareOfCutOut(*light);
  }
  if constexpr (kMedia) {
    InMedia media = path->media;
    if (!CrossOrStay(point, light->wi, IsHair<kTraits>(bsdf), *path, &media)) return;
    const Color share = ShareThroughMedia(point, *light, {u[3], u[2]}, *path, media);
    if (share.IsBlack()) return;
    AddSampled(*light, point.p, value.f_cos * share, ShareOfSample(*light, value.pdf),
               path->history.KindFromSurface(), path);
  } else {
    if (!IsVisible(point, *light, {u[3], u[2]}, path->ray.time)) return;
    AddSampled(*light, point.p, value.f_cos, ShareOfSample(*light, value.pdf),
               path->history.KindFromSurface(), path);
  }
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::AddSampled(const LightSampleOf<Color>& light,
                                                           Vec3f p, const Color& f_cos, float share,
                                                           LightPathKind kind, Path* path) {
  const float scale = share / light.pdf;
  const Color arriving = path->throughput * f_cos * light.radiance * scale;
  if (light.is_infinite && !light.is_delta) {
    AddSky(p, light.wi, path->throughput * f_cos * scale, kind, arriving, path);
  } else {
    AddLight(light.light, kind, arriving, path);
  }
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::SurvivesRoulette(float u, Path* path) const {
  // The square root ends fewer of the paths that bring light to dark places, where relative errors
  // are largest: a tenth more rays, a fifth to a half less relMSE.
  const float survival = std::sqrt(MaxComponent(path->throughput) * path->eta_scale);
  bool may_end = path->depth > scene_.roulette_depth_min;
  if constexpr (kSubsurface) may_end = may_end || path->media.mix.is_matter;
  if (survival < 1 && may_end) {
    const float stop = std::min(kRouletteStopMax, 1 - survival);
    if (u < stop) return false;
    path->throughput *= 1 / (1 - stop);
  }
  return true;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::Scatter(const Sampler& sampler,
                                                        const SurfacePoint& point, const Tilt& tilt,
                                                        const BsdfOf<Color>& bsdf, Vec3f wo_local,
                                                        Vec3f light_hint, Path* path) const {
  const std::array<float, 4> u = sampler.Get4(Slot(LastVertex(*path), VertexSlot::kBsdf));
  const std::optional<BsdfSampleOf<Color>> sample = [&] {
    if constexpr (kMapsNormals) {
      if (tilt.active()) return tilt.template Sample<kTraits>(bsdf, wo_local, u[2], {u[0], u[1]});
    }
    return SampleBsdf<kTraits>(bsdf, wo_local, u[2], {u[0], u[1]});
  }();
  if (!sample.has_value()) return false;
  const Vec3f wi = point.shading.ToWorld(sample->wi);
  if (!AgreesOnSide(bsdf, tilt, sample->wi.z, Dot(wi, point.ng))) return false;
  path->throughput *= sample->weight;
  if (path->throughput.IsBlack()) return false;
  if constexpr (kMedia) {
    if (!CrossOrStay(point, wi, IsHair<kTraits>(bsdf), *path, &path->media)) return false;
  }
  if constexpr (kSubsurface) StartAtBoundary(point, path);
  if constexpr (kLines) path->media.line.has_scattered = false;
  path->eta_scale *= sample->eta_scale;
  path->specular = (sample->flags & kBsdfSpecular) != 0;
  path->history.AddSurface(path->specular);
  path->pdf = sample->pdf;
  path->from = point.p;
  path->from_n = light_hint;
  path->ray.o = OffsetRayOrigin(point.p, point.p_error, point.ng, wi);
  path->ray.d = wi;
  path->ray.source = point.id;
  // Should the ray meet nothing, the sky's radiance will have arrived when that is known.
  path->sky_place = scene_.lights->template PrepareEnvironment<kTraits>(wi);
  return SurvivesRoulette(u[3], path);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
float PathTracer<kTraits, Tracer, kDirectLight>::ShareOfCutOut(
    const LightSampleOf<Color>& light) const {
  const ShapeDescription& shape = scene_.description.shapes[light.cut_out];
  const TexturePoint there{light.uv,
                           ToFloat(ToDouble(light.p_light) + scene_.geometry.render_origin_world)};
  const float share = scene_.materials->template EvaluateFloat<kTraits>(shape.alpha, there);
  return std::min(1.0f, std::max(0.0f, share));
}

}  // namespace sheaf::render
