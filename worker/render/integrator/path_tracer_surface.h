// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, the way of a path from surface to surface, and what shines at its end. Included by
// path_tracer.h.
#pragma once

#include <cstdint>

#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::Trace(const Sampler& sampler, Path* path,
                                                      FilmSample* film) {
  const auto depth_max = static_cast<uint32_t>(scene_.settings.max_depth);
  const Vec3f camera_o = path->ray.o;
  bool is_first = true;
  uint32_t passes = 0;
  for (;;) {
    if constexpr (kSubsurface) {
      if (path->matter.is_near && !WalkNearPlane(sampler, path)) return;
    }
    ++counts_.rays;
    RawHit hit;
    const bool meets = tracer_.Intersect(path->ray, &hit);
    if constexpr (kMedia) {
      const Travel travel =
          TravelThroughMedia(sampler, meets ? &hit : nullptr, &passes, &is_first, path, film);
      if (travel == Travel::kEnded) return;
      if (travel == Travel::kScattered) continue;
    }
    if (!meets) return AddEscape(path);
    // Begun here, the look-up of a light need not be waited for when the surface is known.
    const LightDraw draw = DrawLight(sampler, NextVertex(*path));
    Plane plane;
    SurfacePoint point = MakeSurfacePoint<kTraits>(scene_.geometry, path->ray, hit, &plane);
    const Surface& surface = *point.surface;
    bool in_matter = false;
    if constexpr (kSubsurface) in_matter = ArriveInMatter(surface, path);
    const PassChoice choice = ChoiceAt(sampler, surface, passes, *path);
    bool passes_through = IsCutOut(point, choice.cut_out);
    BsdfOf<Color> bsdf;
    if (!passes_through) {
      if (Has(kTraits, Trait::kAreaLights) && point.emitter != kNoEmitter) AddEmission(point, path);
      // The last vertex needs no material, unless it may turn out not to be there.
      if (path->depth == depth_max && !is_first && !in_matter && !(kMayPass && surface.may_pass)) {
        return;
      }
      bsdf = scene_.materials->template Evaluate<kTraits>(surface.material, TexturePointOf(point),
                                                          choice.mix, path->wavelengths);
      passes_through = kMayPass && bsdf.kind == BsdfKind::kInterface;
      if constexpr (kNested) {
        const BoundaryKind kind = MeetInterior(point, *path, &bsdf);
        if (kind == BoundaryKind::kBroken) return;
        passes_through = passes_through || kind == BoundaryKind::kHidden;
      }
    }
    if (passes_through) {
      if (++passes > kPassesMax) return;
      if constexpr (kMedia) {
        if (!Cross(point, path->ray.d, *path, &path->media)) return;
      }
      path->ray.o = OffsetRayOrigin(point.p, point.p_error, point.ng, path->ray.d);
      path->ray.source = point.id;
      continue;
    }
    passes = 0;
    const Vec3f wo = -path->ray.d;
    // Seen from below its own horizon a shading normal has no meaning: the true one takes its
    // place.
    const bool is_hair = IsHair<kTraits>(bsdf);
    if (!is_hair && Dot(wo, point.shading.n) * Dot(wo, point.ng) <= 0)
      point.shading = Frame::FromNormal(point.ng);
    Tilt tilt;
    if constexpr (kMapsNormals) {
      if (plane && !is_hair)
        tilt = MapNormal(sampler, *plane, choice.mix, NextVertex(*path), wo, &point);
    }
    if (is_first) RecordSurface(bsdf, point, choice.mix, *path, camera_o, film);
    is_first = false;
    if (!CountVertex(in_matter, path)) return;
    if constexpr (kSpectral) {
      if (bsdf.disperses) FollowHero(path);
    }
    const Vec3f wo_local = point.shading.ToLocal(wo);
    // Lights behind an opaque surface need not be looked at.
    Vec3f light_hint{};
    if (!TransmitsLight(bsdf)) light_hint = Dot(wo, point.ng) < 0 ? -point.ng : point.ng;
    if (!bsdf.specular) AddDirect(draw, point, tilt, bsdf, wo_local, light_hint, path);
    if constexpr (kSamplesGlow) AddGlowAtSurface(sampler, point, tilt, bsdf, wo_local, path);
    if (!Scatter(sampler, point, tilt, bsdf, wo_local, light_hint, path)) return;
  }
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::PassChoice
PathTracer<kTraits, Tracer, kDirectLight>::ChoiceAt(const Sampler& sampler, const Surface& surface,
                                                    uint32_t passes, const Path& path) {
  if (!kMayPass || (!surface.has_alpha && !surface.may_pass)) return {};
  const Vec2f u = sampler.Get2(Slot(NextVertex(path), VertexSlot::kSurface));
  return MakeChoice({u.x, u.y}, passes);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
TexturePoint PathTracer<kTraits, Tracer, kDirectLight>::TexturePointOf(
    const SurfacePoint& point) const {
  TexturePoint texture_point;
  if constexpr (Has(kTraits, Trait::kHair)) texture_point.uv = point.uv;
  if constexpr (Has(kTraits, Trait::kTextures)) {
    texture_point.uv = point.uv;
    if (point.surface->reads_textures) {
      texture_point.p_world = ToFloat(ToDouble(point.p) + scene_.geometry.render_origin_world);
    }
  }
  return texture_point;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::AddEscape(Path* path) {
  if constexpr (Has(kTraits, Trait::kEnvironment)) {
    if (path->specular) {
      AddSky(path->from, path->ray.d, path->throughput, path->history.KindMet(),
             path->throughput * scene_.lights->template EnvironmentRadiance<kTraits>(
                                    path->from, path->ray.d, path->wavelengths),
             path);
      return;
    }
    const EnvironmentValueOf<Color> value = scene_.lights->template EvalEnvironment<kTraits>(
        path->from, path->from_n, path->ray.d, path->wavelengths, path->sky_place);
    const float weight = MetShare(path->pdf, value.pdf);
    AddSky(path->from, path->ray.d, path->throughput * weight, path->history.KindMet(),
           path->throughput * value.radiance * weight, path);
  }
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::AddEmission(const SurfacePoint& point, Path* path) {
  if constexpr (Has(kTraits, Trait::kAreaLights)) {
    const Color radiance = scene_.lights->template EmitterRadianceAt<kTraits>(
        point.emitter, point.EmitterNormal(), -path->ray.d, point.uv, path->wavelengths);
    if (radiance.IsBlack()) return;
    float weight = 1;
    if (!path->specular) {
      const float sampled_pdf = scene_.lights->template PdfEmitter<kTraits>(
          point.emitter, path->from, path->from_n, path->ray.d, point.p);
      weight = [&] {
        if constexpr (kLines) {
          const Line& line = path->media.line;
          if (line.has_scattered) return MetShareOnLine(line, point.emitter, sampled_pdf, *path);
        }
        return MetShare(path->pdf, sampled_pdf);
      }();
    }
    AddLight(point.emitter, path->history.KindMet(), path->throughput * radiance * weight, path);
  }
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::CountVertex(bool in_matter, Path* path) {
  if constexpr (kSubsurface) {
    path->matter.vertex = NextVertex(*path);
    if (path->media.mix.is_matter && ++path->matter.steps > kMatterStepsMax) {
      ++counts_.long_walks;
      return false;
    }
    if (in_matter) return true;
  }
  return path->depth++ != static_cast<uint32_t>(scene_.settings.max_depth);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
Rgb PathTracer<kTraits, Tracer, kDirectLight>::AlbedoOf(const BsdfOf<Color>& bsdf,
                                                        const SurfacePoint& point,
                                                        float u_mix) const {
  if constexpr (kSpectral) {
    return scene_.materials
        ->template Evaluate<kRgbTraits>(point.surface->material, TexturePointOf(point), u_mix)
        .albedo;
  } else {
    return bsdf.albedo;
  }
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::RecordSurface(const BsdfOf<Color>& bsdf,
                                                              const SurfacePoint& point,
                                                              float u_mix, const Path& path,
                                                              Vec3f camera_o,
                                                              FilmSample* film) const {
  film->albedo = AlbedoOf(bsdf, point, u_mix);
  film->alpha = 1;
  film->normal = point.shading.n;
  film->depth = Length(point.p - camera_o);
  if constexpr (kOutputs) {
    if (outputs_ != nullptr) RecordFirstHit(scene_, path.ray, point, outputs_);
  }
}

}  // namespace sheaf::render
