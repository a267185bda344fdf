// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The first vertex of a path, as all views see it that share the path (path_views.h). A path that
// was traced from one view is shifted to the others by reconnecting its first vertex to their
// lenses: vertices, and so all else of the path, stay, and the shift has the Jacobian 1 in the
// measure of surface area.
//
// Each view is a technique with one path a pixel, so the balance heuristic over them is exact: a
// path of any view counts in view v with f_v / (the sum of all p). At the first vertex x1, p is a
// density of x1 on its surface, and for the light that x1 scatters towards the path's second vertex
// also one of that direction. Sources: Fraboni et al. 2019, "Efficient Path Reuse for Multi-View
// Rendering"; Lin et al. 2022, "Generalized Resampled Importance Sampling", sec. 5; docs/adr/0150,
// 0151.
#pragma once

#include <array>
#include <cmath>
#include <optional>

#include "worker/render/eyes/sights.h"
#include "worker/render/integrator/path_integrator.h"

namespace sheaf::render {

// The first vertex of a path, seen by several views.
template <typename C>
class SharedVertex {
 public:
  using Color = typename C::Color;
  static constexpr bool kIsSurface = true;

  // own: as the path's view sees it, after Arrive. Both must outlive *this.
  SharedVertex(const Context<C>& c, const SurfaceVertex<C>& own, const ViewsOfPoint& views)
      : point(own.point), light_hint(own.light_hint), own_(own), views_(views) {
    density_ = SightOfView(0).density;
    for (int32_t v = 1; v < views.count; ++v) {
      density_ += SightOfView(v).density;
      others_[static_cast<size_t>(v - 1)].emplace(own.SeenFrom(c, SightOfView(v).wi));
    }
  }

  const SurfacePoint& point;
  const Vec3f light_hint;

  int32_t view_count() const { return views_.count; }
  double density() const { return density_; }
  const Sight& SightOfView(int32_t v) const { return views_.entries[static_cast<size_t>(v)].sight; }
  // As view v sees it.
  const SurfaceVertex<C>& Seen(int32_t v) const {
    return v == 0 ? own_ : *others_[static_cast<size_t>(v - 1)];
  }
  // f * |cos| to view v, for the direction of the last Eval.
  const Color& Found(int32_t v) const { return found_[static_cast<size_t>(v)]; }

  // --- As a vertex of direct lighting, which scatters 1 to all views. The pdf is that of the paths
  // of all views together, over the density of the vertex.
  BsdfValueOf<Color> Eval(Vec3f w) const {
    bool is_black = true;
    double pdf = 0;
    for (int32_t v = 0; v < views_.count; ++v) {
      const BsdfValueOf<Color> value = Seen(v).Eval(w);
      found_[static_cast<size_t>(v)] = value.f_cos;
      is_black = is_black && value.f_cos.IsBlack();
      pdf += SightOfView(v).density * static_cast<double>(value.pdf);
    }
    if (is_black) return {};
    return {Color::Gray(1), static_cast<float>(pdf / density_)};
  }
  float LightSampleWeight(const Context<C>& c, const LightSampleOf<Color>& light, float pdf,
                          const PathState<C>& path) const {
    return own_.LightSampleWeight(c, light, pdf, path);
  }
  bool EnterSide(const Context<C>& c, Vec3f w, const PathState<C>& path,
                 MediumState<C>* media) const {
    return own_.EnterSide(c, w, path, media);
  }
  const LightDraw& Draw(const Context<C>&, const PathState<C>&) const { return own_.draw; }
  LightQuery Query() const { return own_.Query(); }
  LightPathKind LightKind(const PathState<C>& path) const { return own_.LightKind(path); }

 private:
  const SurfaceVertex<C>& own_;
  const ViewsOfPoint& views_;
  double density_ = 0;
  std::array<std::optional<SurfaceVertex<C>>, kPathViewsMax - 1> others_;
  mutable std::array<Color, kPathViewsMax> found_{};
};

// The contributions of a path to the views that share it.
template <typename C>
struct PathShift {
  using Color = typename C::Color;
  struct View {
    Eye eye;
    Vec2d film;    // The point on the film of the eye.
    Vec3f normal;  // As FilmSample has them, of the first vertex.
    float depth;
    // Over the density of the vertex: the share of the view in the light that the path finds,
    // around the film point, where the pixels' filters weigh it per pixel of the film; or in the
    // path's own pixel.
    double part;
    float share;    // The same without the weight of the view's ray; 0 behind a specular prefix.
    Color light;    // The light found at the shared vertex, with the share.
    Color factor;   // The factor of what the rest of the path finds, with the share.
    Color through;  // The throughput up to the shared vertex, over that of the path.
  };
  // The path's own view first. None: the path counts for its own view alone, and fully.
  int32_t count = 0;
  std::array<View, kPathViewsMax> views;
  // Whether the shared vertex is behind a specular prefix. Then the path found `alone` before it,
  // for its own view, and stands for a sample of that view alone.
  bool is_behind_prefix = false;
  Color alone;
};

// Whether paths of several views may share the vertex. Not where the surface scatters into single
// directions only, as each view has its own; nor on curves, which turn towards each ray. Depends on
// the point alone.
template <typename C>
bool MayShare(const SurfaceVertex<C>& vertex) {
  return !vertex.bsdf.specular && !IsHair<C::kTraits>(vertex.bsdf) && !(vertex.point.reach > 0);
}

// Adds the light that sample() finds to all views. Requires: it calls Eval once at most.
template <typename C, typename Sample>
void ShareLight(const SharedVertex<C>& shared, PathShift<C>* shift, PathState<C>* path,
                const Sample& sample) {
  path->radiance = {};
  sample();
  for (int32_t v = 0; v < shift->count; ++v) {
    auto& view = shift->views[static_cast<size_t>(v)];
    const auto share = static_cast<float>(view.part / shared.density());
    view.light += path->radiance * shared.Found(v) * view.through * share;
  }
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

// Continues the path from its first vertex, for all views. own_alone: the share of the path in its
// own view if no other shares it. False where it ends.
template <typename C>
bool ScatterForAll(const Context<C>& c, const SharedVertex<C>& shared, double own_alone,
                   PathShift<C>* shift, PathState<C>* path) {
  using Color = typename C::Color;
  const Color before = path->throughput;
  const SurfaceVertex<C>& own = shared.Seen(0);
  if (!own.Scatter(c, path)) return false;
  shift->views[0].factor = shift->views[0].through * static_cast<float>(own_alone);
  // Paths of other views do not take this direction.
  if (path->specular) return true;
  const Vec3f w = path->ray.d;
  std::array<Color, kPathViewsMax> to;
  const auto pdf = static_cast<double>(path->pdf);
  double density = shared.SightOfView(0).density * pdf;
  for (int32_t v = 1; v < shift->count; ++v) {
    const auto i = static_cast<size_t>(v);
    const BsdfValueOf<Color> value = shared.Seen(v).Eval(w);
    to[i] = value.f_cos;
    density += shared.SightOfView(v).density * static_cast<double>(value.pdf);
  }
  const float survival = RouletteFactor(c, own, before, *path);
  to[0] = path->throughput * shift->views[0].through *
          static_cast<float>(shift->views[0].part * pdf / density);
  // The path carries all together as gray, so that no component of any is lost.
  float carried = MaxComponent(to[0]);
  for (int32_t v = 1; v < shift->count; ++v) {
    const auto i = static_cast<size_t>(v);
    to[i] = before * to[i] * shift->views[i].through *
            static_cast<float>(shift->views[i].part / density * static_cast<double>(survival));
    carried += MaxComponent(to[i]);
  }
  if (!(carried > 0) || !std::isfinite(carried)) return false;
  for (int32_t v = 0; v < shift->count; ++v) {
    shift->views[static_cast<size_t>(v)].factor = to[static_cast<size_t>(v)] * (1 / carried);
  }
  path->throughput = Color::Gray(carried);
  path->pdf = static_cast<float>(density / shared.density());
  return true;
}

// The rays of the view's film that may begin the path, as a density.
inline double RaysOfView(const PathSharing& sharing, const ViewsOfPoint& views, int32_t v) {
  const Sight& sight = views.entries[static_cast<size_t>(v)].sight;
  const bool in_own_pixel = v == 0 && !sharing.by_filter;
  return in_own_pixel ? sight.density : sight.pixels;
}

// The views of the shift, with the emission of the vertex that NextVertex found.
template <typename C>
void StartShift(const Context<C>& c, const PathSharing& sharing, const ViewsOfPoint& views,
                const SharedVertex<C>& shared, const PathState<C>& path, PathShift<C>* shift) {
  using Color = typename C::Color;
  for (int32_t v = 0; v < views.count; ++v) {
    const ViewsOfPoint::Entry& entry = views.entries[static_cast<size_t>(v)];
    const SurfacePoint& seen = shared.Seen(v).point;
    const double rays = RaysOfView(sharing, views, v);
    const double part = rays * entry.sight.weight;
    Color emission;
    if (v == 0) {
      emission = path.radiance;
    } else if constexpr (C::Has(Trait::kAreaLights)) {
      if (seen.emitter != kNoEmitter) {
        emission = c.scene.lights->template EmitterRadianceAt<C::kTraits>(
            seen.emitter, seen.EmitterNormal(), entry.sight.wi, seen.uv, path.wavelengths);
      }
    }
    shift->views[static_cast<size_t>(v)] = {entry.eye,
                                            entry.sight.film,
                                            seen.shading.n,
                                            Length(seen.p - entry.p_lens),
                                            part,
                                            static_cast<float>(rays / shared.density()),
                                            emission * static_cast<float>(part / shared.density()),
                                            Color(),
                                            Color::Gray(1)};
  }
}

// The path arrives at the shared vertex: samples lights and continues it for all views. Requires:
// the views of the shift are set. False where the path ends.
template <typename C>
bool ScatterShared(const Context<C>& c, const PathSharing& sharing, const SharedVertex<C>& shared,
                   PathShift<C>* shift, PathState<C>* path) {
  ShareLight(shared, shift, path, [&] { SampleLd(c, shared, path); });
  if constexpr (C::kSamplesEmission) {
    ShareLight(shared, shift, path, [&] { SampleVolumeEmission(c, shared, path); });
  }
  const Sight& own = shared.SightOfView(0);
  const double own_alone = own.weight * (sharing.by_filter ? own.pixels / own.density : 1);
  return ScatterForAll(c, shared, own_alone, shift, path);
}

// The path arrives at a vertex: shares what it finds with the other views that see it, if there are
// any. start(shared): sets the views of *shift. False where the path ends.
template <typename C, typename Start>
bool ScatterSeenBy(const Context<C>& c, const PathSharing& sharing, const ViewsOfPoint& views,
                   SurfaceVertex<C>& vertex, const Start& start, PathShift<C>* shift,
                   PathState<C>* path, FilmSample* film) {
  if (views.count < 2) return ScatterAt(c, vertex, path, film);
  if (!vertex.Arrive(c, path, film)) return false;
  const SharedVertex<C> shared(c, vertex, views);
  shift->count = views.count;
  start(shared);
  return ScatterShared(c, sharing, shared, shift, path);
}

// The path arrives at its first vertex, a surface, with nothing in between: shares what it finds
// with the other views of its set that may see it, and sets *shift. False where the path ends.
template <typename C>
bool ScatterFirst(const Context<C>& c, const PathSharing& sharing, const PathOrigin& origin,
                  SurfaceVertex<C>& vertex, PathShift<C>* shift, PathState<C>* path,
                  FilmSample* film) {
  ViewsOfPoint views;
  if (MayShare<C>(vertex) && !vertex.in_subsurface) {
    const auto see = [&](const PathView& view, bool is_own, ViewsOfPoint::Entry* entry) {
      return is_own || IsInView(c, vertex.point, entry->sight.wi, entry->p_lens, view.time);
    };
    FindViews(c, sharing, origin, vertex.point, path->ray.time, see, &views);
  }
  const auto start = [&](const SharedVertex<C>& shared) {
    StartShift(c, sharing, views, shared, *path, shift);
  };
  return ScatterSeenBy(c, sharing, views, vertex, start, shift, path, film);
}

}  // namespace sheaf::render
