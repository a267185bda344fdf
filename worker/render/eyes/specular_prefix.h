// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Paths that begin at mirrors and smooth glass, and how views share them: the first surface has no
// direction in common for two views, so a path is shared at the second vertex after its specular
// ones, its prefix. Another view replays the prefix: it begins at the same point of the first
// surface and follows its own directions, by the same random numbers, to a rough vertex of its own.
// From there it is reconnected to the path's next vertex.
//
// A path of any view is a point of the first surface, the random numbers of its prefix, and all
// vertices after the rough one; the shift keeps them, and so has the Jacobian 1. Random numbers
// have the density 1, which leaves the weights to the densities of the first point on its surface
// and of the direction at the rough vertex, as area at the vertex that is shared. Light that the
// rough vertex finds, by light samples and where its direction meets an emitter, is the path's own.
// Source: the hybrid shift of Lin et al. 2022, "Generalized Resampled Importance Sampling",
// sec. 7.2; docs/adr/0350.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <variant>

#include "worker/render/eyes/shared_vertex.h"

namespace sheaf::render {

// Longer prefixes are not shared.
inline constexpr uint32_t kPrefixVerticesMax = 4;
// The distance of two views' first vertices, over that to the camera, that rounding may cause.
inline constexpr double kSamePlaceMax = 1e-3;

// Whether the path is in no medium, through which it would come with a probability of its own.
template <typename C>
bool IsOutsideOfMedia(const PathState<C>& path) {
  if constexpr (C::kMedia) return path.media.set.empty();
  return true;
}

// The surface that the path has met, with nothing in between; otherwise null.
template <typename C>
SurfaceVertex<C>* ClearSurface(const PathState<C>& path, Vertex<C>* vertex) {
  auto* surface = std::get_if<SurfaceVertex<C>>(vertex);
  return surface != nullptr && IsOutsideOfMedia(path) ? surface : nullptr;
}

// A path from the camera at its first rough vertex.
template <typename C>
struct PrefixEnd {
  SurfaceVertex<C> vertex;
  typename C::Color throughput;  // Before the vertex scatters it.
  decltype(PathState<C>::wavelengths) wavelengths;
};

// The parts that are the same for all views of a path.
template <typename C>
struct SpecularPrefix {
  PathOrigin origin;
  decltype(PathState<C>::wavelengths) wavelengths;  // At the camera.
  float time = 0;
  SurfacePoint first;   // The first vertex.
  uint32_t length = 0;  // The number of specular vertices.
};

template <typename C>
bool MayEndPrefix(const SurfaceVertex<C>& vertex) {
  return MayShare<C>(vertex) && !vertex.in_subsurface;
}

// The prefix as another view begins and ends it. None where that view has no such path.
template <typename C>
std::optional<PrefixEnd<C>> ReplayPrefix(const Context<C>& c, const SpecularPrefix<C>& prefix,
                                         const PathView& view, Vec2d film) {
  const Camera& camera = CameraOf(c.scene, view.eye);
  PathState<C> path;
  float weight = 1;
  path.ray = camera.template MakeRay<C::kTraits>(film, view.lens, view.time, &weight);
  if (weight == 0) return std::nullopt;
  path.camera_o = camera.EyeOf(path.ray);
  if constexpr (C::Has(Trait::kEnvironment)) path.from = path.ray.o;
  if constexpr (C::kSpectral) path.wavelengths = prefix.wavelengths;
  if constexpr (C::kMedia) StartInMedia(c, &path);
  FilmSample unused;
  Vertex<C> vertex;
  for (uint32_t i = 0; i <= prefix.length; ++i) {
    NextVertex(c, &path, &vertex);
    SurfaceVertex<C>* const surface = ClearSurface(path, &vertex);
    if (surface == nullptr) return std::nullopt;
    if (i == 0) {
      const double apart = Length(ToDouble(surface->point.p) - ToDouble(prefix.first.p));
      const double away = Length(ToDouble(prefix.first.p) - ToDouble(path.camera_o));
      if (surface->point.surface != prefix.first.surface || apart > kSamePlaceMax * away) {
        return std::nullopt;
      }
    }
    const bool is_last = i == prefix.length;
    if (is_last != MayEndPrefix(*surface) || (!is_last && !surface->bsdf.specular)) {
      return std::nullopt;
    }
    if (!surface->Arrive(c, &path, &unused)) return std::nullopt;
    if (is_last) return PrefixEnd<C>{*surface, path.throughput, path.wavelengths};
    if (!surface->Scatter(c, &path)) return std::nullopt;
  }
  return std::nullopt;
}

// Whether nothing is between two vertices; not even a cut-out.
template <typename C>
bool AreConnected(const Context<C>& c, const SurfacePoint& from, const SurfacePoint& to, Vec3f w,
                  float time) {
  Ray ray;
  ray.time = time;
  Leave(from, w, &ray);
  ray.d = OffsetRayOrigin(to.p, to.p_error, to.ng, -w) - ray.o;
  ray.t_max = 1;
  ++c.counts.rays;
  ++c.counts.shadow_rays;
  return !c.tracer.Occluded(ray);
}

template <typename C>
bool HaveOneColor(const PrefixEnd<C>& a, const PrefixEnd<C>& b) {
  if constexpr (C::kSpectral) return a.wavelengths.pdf == b.wavelengths.pdf;
  return true;
}

// The views that share the path at `point`, the vertex after own's, to which own scattered the
// path: their sights of it, with the throughputs that their own paths would have there.
template <typename C>
void FindViewsBehind(const Context<C>& c, const PathSharing& sharing,
                     const SpecularPrefix<C>& prefix, const PrefixEnd<C>& own, Vec3f own_w,
                     const typename C::Color& own_throughput, float survival,
                     const SurfacePoint& point, ViewsOfPoint* views, PathShift<C>* shift) {
  const auto see = [&](const PathView& view, bool is_own, ViewsOfPoint::Entry* entry) {
    std::optional<PrefixEnd<C>> replayed;
    if (!is_own) {
      replayed = ReplayPrefix(c, prefix, view, entry->sight.film);
      if (!replayed || !HaveOneColor(own, *replayed)) return false;
    }
    const PrefixEnd<C>& end = is_own ? own : *replayed;
    const Vec3d to = ToDouble(point.p) - ToDouble(end.vertex.point.p);
    const double distance_squared = LengthSquared(to);
    if (!(distance_squared > 0)) return false;
    const Vec3f w = is_own ? own_w : ToFloat(to * (1 / std::sqrt(distance_squared)));
    const BsdfValueOf<typename C::Color> value = end.vertex.Eval(w);
    if (!(value.pdf > 0) || value.f_cos.IsBlack()) return false;
    if (!is_own && (!AreOnOneSide(point, -own_w, -w) ||
                    !AreConnected(c, point, end.vertex.point, -w, view.time))) {
      return false;
    }
    // The density of the direction, as area at the point.
    const double area = static_cast<double>(value.pdf) *
                        std::fabs(static_cast<double>(Dot(w, point.ng))) / distance_squared;
    entry->sight.wi = -w;
    entry->sight.density *= area;
    entry->sight.pixels *= area;
    if (!(entry->sight.density > 0) || !std::isfinite(entry->sight.density)) return false;
    shift->views[static_cast<size_t>(views->count)].through =
        is_own ? own_throughput : end.throughput * value.f_cos * (survival / value.pdf);
    return true;
  };
  FindViews(c, sharing, prefix.origin, prefix.first, prefix.time, see, views);
}

// Sets all of the shift but `through`, and makes the path's throughput gray: that of its own view
// is the shift's.
template <typename C>
void StartShiftBehind(const PathSharing& sharing, const ViewsOfPoint& views, PathShift<C>* shift,
                      PathState<C>* path) {
  using Color = typename C::Color;
  shift->is_behind_prefix = true;
  shift->alone = path->radiance;
  const float carried = MaxComponent(path->throughput);
  for (int32_t v = 0; v < views.count; ++v) {
    const ViewsOfPoint::Entry& entry = views.entries[static_cast<size_t>(v)];
    const double rays = RaysOfView(sharing, views, v);
    auto& view = shift->views[static_cast<size_t>(v)];
    const Color through = view.through * (1 / carried);
    view = {entry.eye, entry.sight.film, {},      0,      rays * entry.sight.weight,
            0,         Color(),          Color(), through};
  }
  shift->views[0].share = static_cast<float>(
      sharing.by_filter ? views.entries[0].sight.pixels / views.entries[0].sight.density : 1);
  path->throughput = Color::Gray(carried);
}

// The path arrives at the vertex behind `own`, the end of its prefix. False where the path ends.
template <typename C>
bool ScatterBehind(const Context<C>& c, const PathSharing& sharing, const SpecularPrefix<C>& prefix,
                   const PrefixEnd<C>& own, SurfaceVertex<C>& vertex, float survival,
                   PathShift<C>* shift, PathState<C>* path, FilmSample* film) {
  ViewsOfPoint views;
  if (MayEndPrefix(vertex)) {
    FindViewsBehind(c, sharing, prefix, own, path->ray.d, path->throughput, survival, vertex.point,
                    &views, shift);
  }
  const auto start = [&](const SharedVertex<C>&) { StartShiftBehind(sharing, views, shift, path); };
  return ScatterSeenBy(c, sharing, views, vertex, start, shift, path, film);
}

// Follows a path to its end whose first vertex is specular. wavelengths: those at the camera.
template <typename C>
void FollowSpecularPath(const Context<C>& c, const PathSharing& sharing, const PathOrigin& origin,
                        const decltype(PathState<C>::wavelengths)& wavelengths, Vertex<C>* vertex,
                        PathState<C>* path, FilmSample* film, PathShift<C>* shift) {
  SpecularPrefix<C> prefix{origin, wavelengths, path->ray.time,
                           std::get<SurfaceVertex<C>>(*vertex).point};
  SurfaceVertex<C>* surface = ClearSurface(*path, vertex);
  while (surface != nullptr && surface->bsdf.specular && prefix.length < kPrefixVerticesMax) {
    if (!ScatterAt(c, *surface, path, film)) return;
    ++prefix.length;
    NextVertex(c, path, vertex);
    surface = ClearSurface(*path, vertex);
  }
  bool continues = true;
  if (surface != nullptr && MayEndPrefix(*surface)) {
    const typename C::Color before = path->throughput;
    if (!ScatterAt(c, *surface, path, film)) return;
    const PrefixEnd<C> own{*surface, before, path->wavelengths};
    const bool may_share = !path->specular && IsOutsideOfMedia(*path);
    const float survival = may_share ? RouletteFactor(c, own.vertex, before, *path) : 1;
    NextVertex(c, path, vertex);
    surface = may_share ? ClearSurface(*path, vertex) : nullptr;
    continues = surface != nullptr
                    ? ScatterBehind(c, sharing, prefix, own, *surface, survival, shift, path, film)
                    : ContinueFrom(c, vertex, path, film);
  } else {
    continues = ContinueFrom(c, vertex, path, film);
  }
  if (continues) FollowPath(c, path, film);
}

}  // namespace sheaf::render
