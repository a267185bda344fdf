// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The first vertex of a path, as both eyes of a stereo frame see it. A path that was traced from
// one eye is shifted to the other by reconnecting its first vertex to the other lens: vertices, and
// so all else of the path, stay, and the shift has the Jacobian 1 in the measure of surface area.
//
// Each eye is a technique with one path a pixel, so the balance heuristic over both is exact: a
// path of either eye counts in eye e with f_e / (p_left + p_right), p the density of the path from
// an eye. At the first vertex x1, p is a density of x1 on its surface, and for the light that x1
// scatters towards the path's second vertex also one of that direction. Sources: Fraboni et al.
// 2019, "Efficient Path Reuse for Multi-View Rendering"; Lin et al. 2022, "Generalized Resampled
// Importance Sampling", sec. 5; docs/adr/0150.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "worker/render/camera/eye_camera.h"
#include "worker/render/integrator/path_integrator.h"

namespace sheaf::render {

// How an eye sees a point of a surface.
struct Sight {
  Vec3f wi;    // Unit, from the point to the lens.
  Vec2d film;  // The point on the eye's own film, in pixels.
  // Pixels of the film per area of the surface at the point.
  double pixels = 0;
  // The density of the eye's first vertices there, per area, if it traces one path a pixel. Both
  // are in the same unit of area, which cancels in all ratios.
  double density = 0;
};

// The eye's sight of the point, for the given lens sample. None where no path of the eye can begin
// with it, whatever is between them.
inline std::optional<Sight> SightOf(const CompiledScene& scene, Eye eye, const SurfacePoint& point,
                                    Vec2f lens, float time, Vec3f* p_lens) {
  const std::optional<CameraConnection> seen = scene.eyes->of(eye).SampleWi(point.p, lens, time);
  if (!seen) return std::nullopt;
  const double samples =
      scene.filter.SamplesAt(seen->film, scene.eyes->width_px, scene.settings.height_px);
  Sight sight{seen->wi, seen->film};
  sight.pixels = seen->ray_density * std::fabs(static_cast<double>(Dot(seen->wi, point.ng)));
  sight.density = sight.pixels * samples;
  *p_lens = seen->p_lens;
  if (!(sight.density > 0) || !std::isfinite(sight.density)) return std::nullopt;
  return sight;
}

// The first vertex of a path of one eye, seen by both.
template <typename C>
struct SharedVertex {
  using Color = typename C::Color;
  static constexpr bool kIsSurface = true;

  // own: as the path's eye sees it, after Arrive; other: as the other eye does.
  SharedVertex(const SurfaceVertex<C>& own_vertex, const SurfaceVertex<C>& other_vertex,
               const Sight& own_sight, const Sight& other_sight)
      : point(own_vertex.point),
        light_hint(own_vertex.light_hint),
        own(own_vertex),
        other(other_vertex),
        own_seen(own_sight),
        other_seen(other_sight) {}

  const SurfacePoint& point;
  const Vec3f light_hint;
  const SurfaceVertex<C>& own;
  const SurfaceVertex<C>& other;
  const Sight& own_seen;
  const Sight& other_seen;

  double density() const { return own_seen.density + other_seen.density; }
  // The parts of what a path finds, the same for both eyes, that count in the path's own pixel; and
  // in the other eye, where a pixel's filter weighs them per pixel of its film.
  float own_share() const { return static_cast<float>(own_seen.density / density()); }
  float other_share() const { return static_cast<float>(other_seen.pixels / density()); }

  // --- As a vertex of direct lighting, which scatters 1 to both eyes: found.own and found.other
  // are f * |cos| for the direction of the last call. The pdf is that of both eyes' paths together,
  // over the density of the vertex.
  struct Found {
    Color own, other;
  };
  mutable Found found;
  BsdfValueOf<Color> Eval(Vec3f w) const {
    const BsdfValueOf<Color> to_own = own.Eval(w), to_other = other.Eval(w);
    found = {to_own.f_cos, to_other.f_cos};
    if (found.own.IsBlack() && found.other.IsBlack()) return {};
    return {Color::Gray(1), DirectionPdf(to_own.pdf, to_other.pdf)};
  }
  // own_pdf, other_pdf: the pdfs with which paths of each eye continue in a direction.
  float DirectionPdf(float own_pdf, float other_pdf) const {
    return static_cast<float>((own_seen.density * static_cast<double>(own_pdf) +
                               other_seen.density * static_cast<double>(other_pdf)) /
                              density());
  }
  float LightSampleWeight(const Context<C>& c, const LightSampleOf<Color>& light, float pdf,
                          const PathState<C>& path) const {
    return own.LightSampleWeight(c, light, pdf, path);
  }
  bool EnterSide(const Context<C>& c, Vec3f w, const PathState<C>& path,
                 MediumState<C>* media) const {
    return own.EnterSide(c, w, path, media);
  }
  const LightDraw& Draw(const Context<C>&, const PathState<C>&) const { return own.draw; }
  LightQuery Query() const { return own.Query(); }
  LightPathKind LightKind(const PathState<C>& path) const { return own.LightKind(path); }
};

// The contribution of a path to the other eye.
template <typename C>
struct EyeShift {
  using Color = typename C::Color;
  bool is_shifted = false;  // Otherwise the path counts in its own pixel alone, and fully.
  Vec2d film;               // The point on the film of the other eye.
  Vec3f normal;             // As FilmSample has them, of the first vertex.
  float depth = 0;
  float own_share = 1, other_share = 0;  // SharedVertex.
  Color own, other;                      // The light found at the first vertex, with the shares.
  // The factors of what the rest of the path finds.
  Color own_factor = Color::Gray(1), other_factor;
};

// Whether both eyes see the point from one side, so that its material and the media around it are
// the same for both.
inline bool AreOnOneSide(const SurfacePoint& point, Vec3f a, Vec3f b) {
  return Dot(a, point.ng) * Dot(b, point.ng) > 0;
}

// Whether paths of several eyes may share the vertex. Not where the surface scatters into single
// directions only, as each eye has its own; nor on curves, which turn towards each ray. Depends on
// the point alone.
template <typename C>
bool MayShare(const SurfaceVertex<C>& vertex) {
  return !vertex.bsdf.specular && !IsHair<C::kTraits>(vertex.bsdf) && !(vertex.point.reach > 0);
}

// Whether nothing is between the point and the other eye's lens; not even a cut-out, through which
// a path would come with a probability of its own.
template <typename C>
bool IsInView(const Context<C>& c, const SurfacePoint& point, Vec3f wi, Vec3f p_lens, float time) {
  Ray ray;
  ray.time = time;
  Leave(point, wi, &ray);
  ray.d = p_lens - ray.o;
  ray.t_max = 1;
  ray.end = Ray::End::kFree;
  ++c.counts.rays;
  ++c.counts.shadow_rays;
  return !c.tracer.Occluded(ray);
}

// Adds the light that Sample(c, shared, path) finds to both eyes. Requires: it calls Eval once.
template <typename C, typename Sample>
void ShareLight(const SharedVertex<C>& shared, EyeShift<C>* shift, PathState<C>* path,
                const Sample& sample) {
  path->radiance = {};
  sample();
  shift->own += path->radiance * shared.found.own * shared.own_share();
  shift->other += path->radiance * shared.found.other * shared.other_share();
  path->radiance = {};
}

// The factor by which roulette at the vertex raised the throughput of a path, `before` it came
// there.
template <typename C>
float RouletteFactor(const Context<C>& c, const SurfaceVertex<C>& vertex,
                     const typename C::Color& before, const PathState<C>& path) {
  bool may_end = path.depth > c.scene.roulette_depth_min;
  if constexpr (C::kSubsurface) may_end = may_end || path.media.properties.is_subsurface;
  if (!may_end) return 1;
  const float expected = MaxComponent(before * vertex.Eval(path.ray.d).f_cos) / path.pdf;
  return expected > 0 ? MaxComponent(path.throughput) / expected : 1;
}

// Continues the path from its first vertex, for both eyes. False where it ends.
template <typename C>
bool ScatterForBoth(const Context<C>& c, const SharedVertex<C>& shared, EyeShift<C>* shift,
                    PathState<C>* path) {
  using Color = typename C::Color;
  const Color before = path->throughput;
  if (!shared.own.Scatter(c, path)) return false;
  // The other eye's paths do not take this direction.
  if (path->specular) return true;
  const Vec3f w = path->ray.d;
  const BsdfValueOf<Color> other = shared.other.Eval(w);
  const double own_density = shared.own_seen.density * static_cast<double>(path->pdf);
  const double density = own_density + shared.other_seen.density * static_cast<double>(other.pdf);
  const float survival = RouletteFactor(c, shared.own, before, *path);
  const Color to_own = path->throughput * static_cast<float>(own_density / density);
  const Color to_other =
      before * other.f_cos * static_cast<float>(shared.other_seen.pixels / density * survival);
  // The path carries both together as gray, so that no component of either is lost.
  const float carried = MaxComponent(to_own) + MaxComponent(to_other);
  if (!(carried > 0) || !std::isfinite(carried)) return false;
  shift->own_factor = to_own * (1 / carried);
  shift->other_factor = to_other * (1 / carried);
  path->throughput = Color::Gray(carried);
  path->pdf = shared.DirectionPdf(path->pdf, other.pdf);
  return true;
}

// The path arrives from the eye at its first vertex, a surface, with nothing in between: shares
// with the other eye what it finds, if that may see it, and sets *shift. False where the path ends.
// lens: the lens sample of the path.
template <typename C>
bool ScatterFirst(const Context<C>& c, Eye eye, Vec2f lens, SurfaceVertex<C>& vertex,
                  EyeShift<C>* shift, PathState<C>* path, FilmSample* film) {
  using Color = typename C::Color;
  const bool may_share = MayShare<C>(vertex) && !vertex.in_subsurface;
  Vec3f own_lens, other_lens;
  const float time = path->ray.time;
  std::optional<Sight> own, other;
  if (may_share) {
    own = SightOf(c.scene, eye, vertex.point, lens, time, &own_lens);
    other = SightOf(c.scene, OtherThan(eye), vertex.point, lens, time, &other_lens);
  }
  const bool is_shared = own && other && AreOnOneSide(vertex.point, own->wi, other->wi) &&
                         IsInView(c, vertex.point, other->wi, other_lens, time);
  if (!is_shared) return ScatterAt(c, vertex, path, film);
  if (!vertex.Arrive(c, path, film)) return false;
  SurfaceVertex<C> from_other = vertex.SeenFrom(c, other->wi);
  const SharedVertex<C> shared(vertex, from_other, *own, *other);
  shift->is_shifted = true;
  shift->film = other->film;
  shift->normal = from_other.point.shading.n;
  shift->depth = Length(vertex.point.p - other_lens);
  shift->own_share = shared.own_share();
  shift->other_share = shared.other_share();
  // The emission that NextVertex found.
  shift->own = path->radiance * shared.own_share();
  if constexpr (C::Has(Trait::kAreaLights)) {
    if (vertex.point.emitter != kNoEmitter) {
      const Color emission = c.scene.lights->template EmitterRadianceAt<C::kTraits>(
          vertex.point.emitter, vertex.point.EmitterNormal(), other->wi, vertex.point.uv,
          path->wavelengths);
      shift->other = emission * shared.other_share();
    }
  }
  ShareLight(shared, shift, path, [&] { SampleLd(c, shared, path); });
  if constexpr (C::kSamplesEmission) {
    ShareLight(shared, shift, path, [&] { SampleVolumeEmission(c, shared, path); });
  }
  return ScatterForBoth(c, shared, shift, path);
}

}  // namespace sheaf::render
