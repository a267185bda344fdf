// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The sight of a path's rays by their kinds (docs/adr/0330, docs/adr/0380).
//
// A path reaches a light from an event if rays of that event's kind see the light, and no shape
// that casts shadows is between them. Scattering and light sampling find lights by this one rule,
// so that their weights stay those of Veach 1997, ch. 9.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>

#include "common/math/mix_bits.h"
#include "worker/render/bsdf/diffuse_share.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/integrator/context.h"

namespace sheaf::render {

inline constexpr RayMask kShadowRay = BitOf(RayKind::kShadow);

// Begins a ray of the kind.
template <typename C>
void BeginRay([[maybe_unused]] RayKind kind, [[maybe_unused]] PathState<C>* path) {
  if constexpr (C::kRayKinds) {
    path->rays = {kind};
    path->ray.mask = BitOf(kind);
  }
}

// Whether the path sees a light with these invisible kinds where its ray meets it.
template <typename C>
bool SeesLight([[maybe_unused]] RayKinds invisible, [[maybe_unused]] const PathState<C>& path) {
  if constexpr (C::kRayKinds) {
    return !path.rays.has_searched && (invisible & BitOf(path.rays.kind)) == 0;
  }
  return true;
}

// Whether the path looks for lights alone.
template <typename C>
bool SearchesLights([[maybe_unused]] const PathState<C>& path) {
  if constexpr (C::kRayKinds) return path.rays.searches;
  return false;
}

// The kinds of rays that do not see the light of the sample.
template <typename C>
RayKinds InvisibleOf(const Context<C>& c, const LightSampleOf<typename C::Color>& light) {
  const RayVisibility& visibility = c.scene.visibility;
  return light.is_infinite && !light.is_delta ? visibility.sky : visibility.OfLight(light.light);
}

// The radiance at p along w of the infinite lights that the kind of ray sees. Requires:
// RayVisibility::skies_differ.
template <typename C>
typename C::Color SkySeenBy(const Context<C>& c, RayKind kind, Vec3f p, Vec3f w,
                            const PathState<C>& path) {
  using Color = typename C::Color;
  Color sum;
  for (uint32_t i = c.scene.lights->first_infinite(); i < c.scene.lights->light_count(); ++i) {
    if ((c.scene.visibility.OfLight(i) & BitOf(kind)) != 0) continue;
    sum += c.scene.lights->template RadianceOfInfinite<Color>(i, p, w, path.wavelengths);
  }
  return sum;
}

// Where the camera's ray ends, in lengths of its direction: at the far plane.
template <typename C>
double FarClipOf([[maybe_unused]] const Context<C>& c, [[maybe_unused]] const PathState<C>& path) {
  if constexpr (C::kRayKinds) {
    if (path.rays.kind == RayKind::kCamera && c.scene.camera.HasFarClip()) {
      return std::max(0.0, c.scene.camera.FarClip(path.ray));
    }
  }
  return std::numeric_limits<double>::infinity();
}

// For events on surfaces: the path arrives along path.ray.d and continues along w.

template <typename C, typename Vertex>
bool GoesThrough(const Vertex& vertex, Vec3f w, const PathState<C>& path) {
  return !IsHair<C::kTraits>(vertex.bsdf) &&
         Dot(w, vertex.point.ng) * Dot(path.ray.d, vertex.point.ng) > 0;
}

// The part of what the vertex scatters along w, by color, that goes along diffuse rays; the rest
// are glossy ones. Requires: the path does not go through.
template <typename C, typename Vertex>
typename C::Color DiffuseShareAt(const Vertex& vertex, Vec3f w) {
  return DiffuseShare<C::kTraits>(vertex.bsdf, vertex.wo_local, vertex.point.shading.ToLocal(w));
}

// The part of what the vertex scatters from w that rays of its kinds bring from a light that is
// invisible to some.
template <typename C, typename Vertex>
typename C::Color SeenPart(const Vertex& vertex, Vec3f w, RayKinds invisible,
                           const PathState<C>& path) {
  using Color = typename C::Color;
  const auto seen_by = [invisible](RayKind kind) {
    return Color::Gray((invisible & BitOf(kind)) == 0 ? 1 : 0);
  };
  if constexpr (Vertex::kIsSurface) {
    if (vertex.in_subsurface) return seen_by(RayKind::kDiffuse);
    if (GoesThrough(vertex, w, path)) return seen_by(RayKind::kTransmission);
    const Color diffuse = seen_by(RayKind::kDiffuse), glossy = seen_by(RayKind::kGlossy);
    if (diffuse == glossy) return diffuse;
    const Color share = DiffuseShareAt<C>(vertex, w);
    return MakeColor<Color>(
        [&](size_t i) { return share[i] * diffuse[i] + (1 - share[i]) * glossy[i]; });
  } else {
    const bool beneath = path.media.properties.is_subsurface;
    return seen_by(beneath ? RayKind::kDiffuse : RayKind::kVolume);
  }
}

// The radiance of a sample of the sky, times the part of what the vertex scatters whose rays see
// it. Requires: RayVisibility::skies_differ.
template <typename C, typename Vertex>
typename C::Color SeenSky(const Context<C>& c, const Vertex& vertex, Vec3f w,
                          const PathState<C>& path) {
  using Color = typename C::Color;
  Color sum;
  for (uint32_t i = c.scene.lights->first_infinite(); i < c.scene.lights->light_count(); ++i) {
    sum +=
        c.scene.lights->template RadianceOfInfinite<Color>(i, vertex.point.p, w, path.wavelengths) *
        SeenPart(vertex, w, c.scene.visibility.OfLight(i), path);
  }
  return sum;
}

// Begins the ray along w that a surface scatters. Where diffuse and glossy rays see different
// things, one of the kinds is chosen by its share. u: two numbers that chose the direction.
template <typename C, typename Vertex>
void BeginScatteredRay(const Vertex& vertex, Vec3f w, bool is_specular, std::array<float, 2> u,
                       bool splits_lobes, PathState<C>* path) {
  using Color = typename C::Color;
  if (vertex.in_subsurface || path->media.properties.is_subsurface) {
    return BeginRay(RayKind::kDiffuse, path);
  }
  if (GoesThrough(vertex, w, *path)) return BeginRay(RayKind::kTransmission, path);
  if (is_specular || !splits_lobes) return BeginRay(RayKind::kGlossy, path);
  const Color share = DiffuseShareAt<C>(vertex, w);
  const float p = MeanComponent(share);
  const uint64_t bits =
      MixBits((uint64_t{std::bit_cast<uint32_t>(u[0])} << 32) | std::bit_cast<uint32_t>(u[1]));
  const bool is_diffuse = static_cast<float>(bits >> 40) * 0x1p-24f < p;
  path->throughput *= MakeColor<Color>(
      [&](size_t i) { return is_diffuse ? share[i] / p : (1 - share[i]) / (1 - p); });
  BeginRay(is_diffuse ? RayKind::kDiffuse : RayKind::kGlossy, path);
}

// Whether the point's surface bounds a medium or an interior that the path is in. Requires: it
// bounds one.
template <typename C>
bool IsInside(const Context<C>& c, const Surface& surface, const MediumState<C>& media) {
  if constexpr (C::kNested) {
    if (surface.rank != kNoRank) return media.interiors.Contains(surface.rank);
  }
  const bool has_inside = surface.media.inside != kNone;
  const int32_t medium = has_inside ? surface.media.inside : surface.media.outside;
  const auto index = static_cast<uint16_t>(c.scene.media->IndexOf(medium));
  return media.set.Contains(index) == has_inside;
}

// Whether a ray along d with these media passes the surface as if it were not there. A path leaves
// what it has entered, and nothing else, whatever its ray sees: the tracer shows boundaries to all
// rays.
template <typename C>
bool IsUnseen(const Context<C>& c, const SurfacePoint& point, Vec3f d, RayMask ray,
              const MediumState<C>& media) {
  const Surface& surface = *point.surface;
  if (surface.invisible == 0 || (surface.rank == kNoRank && !surface.media.Separates()))
    return false;
  if (Dot(d, point.ng) > 0) return !IsInside(c, surface, media);
  return (surface.invisible & ray) != 0;
}

// The kind of ray by which the path's ray sees boundaries.
template <typename C>
RayMask BoundaryRayOf(const PathState<C>& path) {
  return path.rays.searches ? kShadowRay : BitOf(path.rays.kind);
}

// Whether volume rays see anything of the sampled light at p; sets the radiance that they see.
template <typename C>
bool IsSeenInMedium([[maybe_unused]] const Context<C>& c, [[maybe_unused]] Vec3f p,
                    [[maybe_unused]] const PathState<C>& path,
                    [[maybe_unused]] LightSampleOf<typename C::Color>* light) {
  if constexpr (C::kRayKinds) {
    if ((InvisibleOf(c, *light) & BitOf(RayKind::kVolume)) != 0) return false;
    if (c.scene.visibility.skies_differ && light->is_infinite && !light->is_delta) {
      light->radiance = SkySeenBy(c, RayKind::kVolume, p, light->wi, path);
    }
  }
  return true;
}

// Continues the ray behind a surface that it does not see.
template <typename C>
void PassUnseen(const SurfacePoint& point, Ray* ray, MediumState<C>* media) {
  media->near = {};
  Leave(point, ray->d, ray);
}

}  // namespace sheaf::render
