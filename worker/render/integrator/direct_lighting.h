// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Direct lighting: light samples at a vertex, and the emission of lights that a path's ray hits.
// Multiple importance sampling combines the two. Written once for surfaces and media: a vertex is a
// SurfaceVertex or a MediumVertex.
#pragma once

#include <array>
#include <optional>
#include <utility>

#include "worker/render/integrator/context.h"
#include "worker/render/integrator/equiangular_sampling.h"
#include "worker/render/integrator/light_draw.h"
#include "worker/render/integrator/light_splits.h"
#include "worker/render/integrator/mis_weights.h"
#include "worker/render/integrator/ray_sight.h"
#include "worker/render/integrator/transmittance.h"
#include "worker/render/integrator/two_ends.h"
#include "worker/render/integrator/visibility.h"

namespace sheaf::render {

// Adds light from a light sample that the vertex scatters back along the path. u: for cut-outs on
// the way to it.
template <typename C, typename Vertex>
void AddLightSample(const Context<C>& c, const Vertex& vertex,
                    LightSampleOf<typename C::Color>* light, std::array<float, 2> u,
                    PathState<C>* path) {
  using Color = typename C::Color;
  const BsdfValueOf<Color> value = vertex.Eval(light->wi);
  if (value.f_cos.IsBlack()) return;
  ApplyCutOut(c, light);
  Color f_cos = value.f_cos;
  if constexpr (C::kRayKinds) {
    if (c.scene.visibility.skies_differ && light->is_infinite && !light->is_delta) {
      light->radiance = SeenSky(c, vertex, light->wi, *path);
      if (light->radiance.IsBlack()) return;
    } else if (const RayKinds invisible = InvisibleOf(c, *light); invisible != 0) {
      f_cos = f_cos * SeenPart(vertex, light->wi, invisible, *path);
      if (f_cos.IsBlack()) return;
    }
  }
  if constexpr (C::kMedia) {
    float kept = 1;
    if constexpr (!Vertex::kIsSurface) {
      kept = PlayShadowRoulette(c, vertex.point.p, *light, u, *path);
      if (kept == 0) return;
    }
    MediumState<C> media = path->media;
    if (!vertex.EnterSide(c, light->wi, *path, &media)) return;
    const Color transmittance =
        ShadowTransmittance(c, vertex.point, *light, u, *path, std::move(media)) * kept;
    f_cos = f_cos * transmittance;
    NoteLight(c, {vertex.point.p, vertex.light_hint}, *light, !transmittance.IsBlack(), f_cos);
    if (transmittance.IsBlack()) return;
  } else {
    const bool is_visible = IsVisible(c, vertex.point, *light, u, path->ray.time);
    NoteLight(c, {vertex.point.p, vertex.light_hint}, *light, is_visible, f_cos);
    if (!is_visible) return;
  }
  const float weight = vertex.LightSampleWeight(c, *light, value.pdf, *path);
  const float scale = weight / light->pdf;
  const Color arriving = path->throughput * f_cos * light->radiance * scale;
  if (light->is_infinite && !light->is_delta) {
    AddInfiniteLight(c, vertex.point.p, light->wi, path->throughput * f_cos * scale,
                     vertex.LightKind(*path), arriving, path);
  } else {
    AddLight(c, light->light, vertex.LightKind(*path), arriving, path);
  }
}

// Adds light from one sample of each part of the lights. Requires: the vertex's query is for more
// than one.
template <typename C, typename Vertex>
void SampleParts(const Context<C>& c, const Vertex& vertex, PathState<C>* path) {
  const LightTable& lights = *c.scene.lights;
  const LightQuery query = vertex.Query();
  const auto row = RowFor<C::kTraits>(query.row);
  const Vec3f p = vertex.point.p, n = vertex.light_hint;
  const LightCut cut = lights.choice().CutAt(p, n, query.samples_max, row);
  const uint32_t index = LastVertexIndex(*path);
  for (uint32_t part = 0; part < cut.size(); ++part) {
    const std::array<float, 4> u =
        part == 0 ? vertex.Draw(c, *path).u : c.sampler.Get4(LightPartSlot(index, part));
    const ChosenLight chosen =
        lights.choice().ChooseFrom(cut, part, p, n, u[2], SaltOf({u[0], u[1]}), row);
    std::optional<LightSampleOf<typename C::Color>> light =
        lights.template SampleOfPart<C::kTraits>(chosen, p, n, {u[0], u[1]}, path->wavelengths,
                                                 query);
    if (light) AddLightSample(c, vertex, &*light, {u[3], u[2]}, path);
  }
}

// Adds light from sampled lights that the vertex scatters back along the path.
template <typename C, typename Vertex>
void SampleLd(const Context<C>& c, const Vertex& vertex, PathState<C>* path) {
  if (c.scene.lights->empty()) return;
  if constexpr (C::kSplitsLights) {
    if (vertex.Query().samples_max > 1) return SampleParts(c, vertex, path);
  }
  const LightDraw& draw = vertex.Draw(c, *path);
  const std::array<float, 4>& u = draw.u;
  std::optional<LightSampleOf<typename C::Color>> light =
      c.scene.lights->template Sample<C::kTraits>(vertex.point.p, vertex.light_hint, u[2],
                                                  {u[0], u[1]}, path->wavelengths, draw.preparation,
                                                  vertex.Query());
  if (light) AddLightSample(c, vertex, &*light, {u[3], u[2]}, path);
}

// Adds the radiance of infinite lights along the path's ray, which hits nothing.
template <typename C>
void AddInfiniteLe(const Context<C>& c, PathState<C>* path) {
  if constexpr (C::Has(Trait::kEnvironment)) {
    using Color = typename C::Color;
    if constexpr (C::kRayKinds) {
      if (!SeesLight(c.scene.visibility.sky, *path)) return;
    }
    // The path's ray sees this of the sky.
    const auto seen = [&](const Color& sky) {
      if constexpr (C::kRayKinds) {
        if (c.scene.visibility.skies_differ) {
          return SkySeenBy(c, path->rays.kind, path->from, path->ray.d, *path);
        }
      }
      return sky;
    };
    if (path->specular && (!C::kBothEnds || path->is_camera_path)) {
      AddInfiniteLight(
          c, path->from, path->ray.d, path->throughput, path->history.KindAtHit(),
          path->throughput * seen(c.scene.lights->template EnvironmentRadiance<C::kTraits>(
                                 path->from, path->ray.d, path->wavelengths)),
          path);
      return;
    }
    if constexpr (C::kHeterogeneous) {
      // The last vertex may be one in a medium, which did not look for it.
      if (path->from_n == Vec3f{}) {
        path->sky_place = c.scene.lights->template PrepareEnvironment<C::kTraits>(path->ray.d);
      }
    }
    const EnvironmentValueOf<Color> value = c.scene.lights->template EvalEnvironment<C::kTraits>(
        path->from, path->from_n, path->ray.d, path->wavelengths, path->sky_place,
        LightQueryAtLast<C>(*path));
    const float weight = [&] {
      if constexpr (C::kBothEnds) {
        const double emitted = c.emission.InfiniteDensityAt(path->from, -path->ray.d);
        return HitWeight(c, static_cast<double>(value.pdf), emitted, *path);
      }
      return MisWeight<C>(FindsBy::kHit, path->pdf, value.pdf);
    }();
    AddInfiniteLight(c, path->from, path->ray.d, path->throughput * weight,
                     path->history.KindAtHit(), path->throughput * seen(value.radiance) * weight,
                     path);
  }
}

// Adds the emission of the surface that the path's ray hits. Requires: the point is an emitter's.
template <typename C>
void AddEmittedLe(const Context<C>& c, const SurfacePoint& point, PathState<C>* path) {
  if constexpr (C::Has(Trait::kAreaLights)) {
    if (!SeesLight(point.surface->invisible, *path)) return;
    if constexpr (C::kChains) {
      if (IsFoundByChain(c, point.emitter, *path)) return;
    }
    const typename C::Color radiance = c.scene.lights->template EmitterRadianceAt<C::kTraits>(
        point.emitter, point.EmitterNormal(), -path->ray.d, point.uv, path->wavelengths);
    if (radiance.IsBlack()) return;
    float weight = 1;
    if constexpr (C::kBothEnds) {
      const double sampled =
          path->specular ? 0
                         : static_cast<double>(c.scene.lights->template PdfEmitter<C::kTraits>(
                               point.emitter, path->from, path->from_n, path->ray.d, point.p,
                               LightQueryAtLast<C>(*path)));
      const double emitted = c.emission.DensityAt(point.emitter, path->from, point.p,
                                                  point.EmitterNormal(), -path->ray.d);
      const double line =
          LineOverSample(c, *path, point.emitter, path->from, LightsFromLast<C>(*path));
      weight = HitWeight(c, sampled, emitted, *path, line);
    } else if (!path->specular) {
      const float light_pdf = c.scene.lights->template PdfEmitter<C::kTraits>(
          point.emitter, path->from, path->from_n, path->ray.d, point.p,
          LightQueryAtLast<C>(*path));
      weight = [&] {
        if constexpr (C::kLines) {
          const LineOf<C>& line = path->media.line;
          if (line.has_scattered) return HitWeightOnLine(c, line, point.emitter, light_pdf, *path);
        }
        return MisWeight<C>(FindsBy::kHit, path->pdf, light_pdf);
      }();
    }
    AddLight(c, point.emitter, path->history.KindAtHit(), path->throughput * radiance * weight,
             path);
  }
}

}  // namespace sheaf::render
