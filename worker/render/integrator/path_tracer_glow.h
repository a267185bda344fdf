// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, light from media that shine and vary: at each vertex one ray towards where they do,
// and what all media shine with along it, up to the first surface that lets nothing pass. Scattered
// rays gather the same along theirs (AddGlow); of what both may find, multiple importance sampling
// by directions gives each its share. Included by path_tracer.h. Source: glow_lights.h.
#pragma once

#include <array>

#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
template <typename Towards>
void PathTracer<kTraits, Tracer, kDirectLight>::AddSampledGlow(const Sampler& sampler,
                                                               const SurfacePoint& point,
                                                               const Towards& towards, Path* path) {
  if (!scene_.media || scene_.media->glow_lights().empty()) return;
  const GlowLights& lights = scene_.media->glow_lights();
  const std::array<float, 4> u = sampler.Get4(GlowSlot(LastVertex(*path)));
  const GlowLights::Sample sample = lights.SampleFrom(point.p, u);
  if (!(sample.pdf > 0)) return;
  InMedia media = path->media;
  const BsdfValueOf<Color> value = towards(sample.w, &media);
  if (value.f_cos.IsBlack()) return;
  Ray ray;
  ray.time = path->ray.time;
  ray.source = point.id;
  ray.o = OffsetRayOrigin(point.p, point.p_error, point.ng, sample.w);
  ray.d = sample.w;
  Color sum;
  const auto add = [&](const Ray& segment, uint32_t pass, double length, const Color& share,
                       const InMedia& in) {
    if (in.mix.emission.IsBlack() && !in.mix.glows) return;
    sum += share * (in.mix.varies ? EmissionAmongVarying(segment, u, pass, length, *path, in)
                                  : EmissionAlong(in.mix, length));
  };
  PassThroughMedia(ray, nullptr, {u[3], u[2]}, *path, media, add);
  const float share = SampledShare(sample.pdf, value.pdf);
  const Color arriving = path->throughput * value.f_cos * sum * (share / sample.pdf);
  path->radiance += arriving;
  if constexpr (kOutputs) groups_.AddGlow(scene_.media_group, arriving);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::AddGlowAtSurface(const Sampler& sampler,
                                                                 const SurfacePoint& point,
                                                                 const Tilt& tilt,
                                                                 const BsdfOf<Color>& bsdf,
                                                                 Vec3f wo_local, Path* path) {
  if (bsdf.specular) return;
  const auto towards = [&](Vec3f w, InMedia* media) {
    const BsdfValueOf<Color> value = ValueTowards(w, point, tilt, bsdf, wo_local);
    const bool may_go =
        value.f_cos.IsBlack() || CrossOrStay(point, w, IsHair<kTraits>(bsdf), *path, media);
    return may_go ? value : BsdfValueOf<Color>{};
  };
  AddSampledGlow(sampler, point, towards, path);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
float PathTracer<kTraits, Tracer, kDirectLight>::MetShareOfGlow(const Path& path) const {
  const GlowLights& lights = scene_.media->glow_lights();
  if (path.specular || lights.empty()) return 1;
  const float pdf = lights.Pdf(path.from, path.ray.d);
  return pdf > 0 ? MetShare(path.pdf, pdf) : 1;
}

}  // namespace sheaf::render
