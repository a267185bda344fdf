// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Chains of smooth interfaces from a surface vertex: tracing one from its first direction, through
// given reflections and refractions, with the media on its way.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "worker/render/bsdf/fresnel.h"
#include "worker/render/chains/chain_ray.h"
#include "worker/render/geometry/normal_derivative.h"
#include "worker/render/integrator/next_vertex.h"
#include "worker/render/integrator/surface_vertex.h"
#include "worker/render/scene/chain_table.h"

namespace sheaf::render {

// A chain up to its last interface.
struct Chain {
  ChainType type{};
  Vec3d w{};       // The direction in which it leaves the vertex.
  ChainRay ray{};  // Leaves the last interface.
  Vec3d first{};   // The first interface, and its derivatives by the coordinates of the ray.
  std::array<Vec3d, 2> first_dp{};
  Vec3d last_normal{};  // The surface's, unit.
  int32_t first_shape = kNone;
  double probability = 1;  // With which scattering chooses the events of its interfaces.
};

// Whether a vertex whose BSDF is known may be an interface of a chain, for a path that arrives as
// it was prepared for. The normal must be the surface's own: one that was bent for the path turns
// in another way.
template <typename C>
bool IsInterface(const Context<C>& c, const SurfaceVertex<C>& vertex) {
  const SurfacePoint& point = vertex.point;
  const Vec3f n = point.shading.n;
  // Steeper vertex normals were pulled towards the surface's.
  constexpr float kCosineMin = static_cast<float>(internal::kShadingCosineMin) + 1e-3f;
  return c.scene.chains->IsCaster(point.surface->shape) && vertex.bsdf.specular &&
         (vertex.bsdf.kind == BsdfKind::kDielectric || vertex.bsdf.kind == BsdfKind::kConductor) &&
         !vertex.in_subsurface && n == vertex.interpolated_shading.n &&
         Dot(n, point.ng) > kCosineMin;
}

// False where numbers have overflowed.
inline bool IsDirection(Vec3d w) { return std::fabs(LengthSquared(w) - 1) < 0.5; }

enum class Met : uint8_t { kNothing, kOther, kInterface };

// Multiplies the path by the transmittance of the media along its ray up to the hit. u: for
// heterogeneous media.
template <typename C>
void Attenuate(const Context<C>& c, const RawHit& hit, std::array<float, 2> u, uint32_t segment,
               PathState<C>* path) {
  const MediumState<C>& media = path->media;
  if (media.set.empty()) return;
  const double length = static_cast<double>(hit.t) * Length(ToDouble(path->ray.d));
  path->throughput *= TransmittanceOf<C::kChromaticMedia>(media.properties, length);
  if constexpr (C::kHeterogeneous) {
    if (media.properties.is_heterogeneous) {
      path->throughput *=
          TransmittanceHeterogeneous(c, path->ray, u, segment, length, *path, media);
    }
  }
}

// Follows the path's ray to the next surface that scatters light, through hidden boundaries. Sets
// *at and *hit unless it meets nothing. u: as for Attenuate; null for no transmittance.
template <typename C>
Met MeetSurface(const Context<C>& c, const std::array<float, 2>* u, PathState<C>* path, RawHit* hit,
                std::optional<SurfaceVertex<C>>* at) {
  for (uint32_t crossing = 0; crossing < kNullCrossingsMax; ++crossing) {
    ++c.counts.rays;
    if (!c.tracer.Intersect(path->ray, hit)) return Met::kNothing;
    if (path->ray.contact > 0) AdvanceToPlace(&path->ray, hit);
    if constexpr (C::kMedia) {
      if (u != nullptr) Attenuate(c, *hit, *u, (path->depth << 16) + crossing, path);
    }
    SurfaceVertex<C>& vertex = at->emplace(c, *hit, *path);
    const Surface& surface = *vertex.point.surface;
    const bool is_caster = c.scene.chains->IsCaster(surface.shape);
    const bool has_rank = C::kNested && surface.rank != kNoRank;
    if (surface.has_alpha || surface.encloses_subsurface) return Met::kOther;
    // A boundary with a priority may be hidden; other surfaces that rays may pass scatter by
    // chance.
    if (!has_rank && (surface.may_pass || !is_caster)) return Met::kOther;
    vertex.bsdf = c.scene.materials->template Evaluate<C::kTraits>(
        surface.material, TexturePointOf(c, vertex.point), 0, path->wavelengths);
    if constexpr (C::kNested) {
      const BoundaryKind kind = ResolveInterior(c, vertex.point, *path, &vertex.bsdf);
      if (kind == BoundaryKind::kBroken) return Met::kNothing;
      if (kind == BoundaryKind::kHidden || vertex.bsdf.kind == BsdfKind::kInterface) {
        const Vec3f d = path->ray.d;
        if (!CrossBoundary(c, vertex.point, d, *path, &path->media)) return Met::kNothing;
        Leave(vertex.point, d, &path->ray);
        continue;
      }
    }
    if (!is_caster) return Met::kOther;
    vertex.Prepare(c, -path->ray.d);
    return IsInterface(c, vertex) ? Met::kInterface : Met::kOther;
  }
  return Met::kNothing;
}

enum class ChainEvent : uint8_t { kReflect, kRefract, kStop };

// Takes the chain and the path through the interface that they meet. choose(reflectance), of the
// primary wavelength, gives the event. False where the event cannot be.
template <typename C, typename Choose>
bool PassInterface(const Context<C>& c, const SurfaceVertex<C>& at, const RawHit& hit,
                   const Choose& choose, PathState<C>* path, Chain* chain) {
  const SurfacePoint& point = at.point;
  const Vec3d p = ToDouble(point.p), n = Normalize(ToDouble(point.shading.n));
  ChainRay& ray = chain->ray;
  if constexpr (C::kSpectral) {
    if (at.bsdf.disperses) TerminateSecondaryWavelengths(path);
  }
  // As the BSDF sees it: outside is the side of the normal.
  const double cosine = -Dot(ray.d, n);
  const float cos_i = std::min(1.0f, static_cast<float>(std::fabs(cosine)));
  const float eta = cosine < 0 ? 1 / at.bsdf.eta : at.bsdf.eta;
  const bool is_metal = at.bsdf.kind == BsdfKind::kConductor;
  const float reflectance = is_metal ? 1 : FresnelDielectric(cos_i, eta).reflectance;
  const ChainEvent event = choose(reflectance);
  if (event == ChainEvent::kStop || (event == ChainEvent::kRefract && !(reflectance < 1))) {
    return false;
  }
  ray.MoveTo(p, ToDouble(point.ng));
  const std::array<Vec3d, 2> first_dp = ray.dp;
  const GeometryGroup& world = c.scene.geometry.groups[0];
  const std::array<Vec3d, 2> dn = {NormalDerivative(world, hit, p, n, ray.dp[0]),
                                   NormalDerivative(world, hit, p, n, ray.dp[1])};
  if (event == ChainEvent::kReflect) {
    ray.Reflect(n, dn);
    chain->probability *= static_cast<double>(reflectance);
    path->throughput *= is_metal
                            ? FresnelConductor(cos_i, at.bsdf.conductor_eta, at.bsdf.conductor_k)
                            : C::Color::Gray(reflectance);
  } else {
    if (!ray.Refract(n, dn, static_cast<double>(eta))) return false;
    chain->probability *= static_cast<double>(1 - reflectance);
    path->throughput *= (1 - reflectance) / (eta * eta);
  }
  if (!IsDirection(ray.d)) return false;
  // Both normals must agree on the side, or the BSDF turns the light elsewhere.
  const Vec3f w = ToFloat(ray.d);
  if (!(Dot(w, point.shading.n) * Dot(w, point.ng) > 0)) return false;
  if constexpr (C::kMedia) {
    if (!at.EnterSide(c, w, *path, &path->media)) return false;
  }
  Leave(point, w, &path->ray);
  path->ray.d = w;
  path->history.AddSurface(true);
  ++path->depth;
  if (chain->type.count == 0) {
    chain->first = p;
    chain->first_dp = first_dp;
    chain->first_shape = point.surface->shape;
  }
  chain->last_normal = ToDouble(point.ng);
  if (event == ChainEvent::kRefract) chain->type.refractions |= 1u << chain->type.count;
  ++chain->type.count;
  return true;
}

// Makes the path leave the vertex, where it is, along w. False where no light arrives from there.
template <typename C>
bool LeaveVertex(const Context<C>& c, const SurfaceVertex<C>& vertex, Vec3d w, PathState<C>* path,
                 Chain* chain) {
  if (!IsDirection(w)) return false;
  const Vec3f d = ToFloat(w);
  if constexpr (C::kMedia) {
    if (!vertex.EnterSide(c, d, *path, &path->media)) return false;
    if constexpr (C::kSubsurface) {
      if (path->media.properties.is_subsurface) return false;
    }
  }
  Leave(vertex.point, d, &path->ray);
  path->ray.d = d;
  path->history.AddSurface(false);
  *chain = {.w = w, .ray = ChainRay(ToDouble(vertex.point.p), w)};
  return true;
}

// Traces the chain of the type that leaves the vertex along w, up to its last interface. u: as for
// MeetSurface. *path: a copy of the path at the vertex. False where there is none.
template <typename C>
bool TraceChain(const Context<C>& c, const SurfaceVertex<C>& vertex, Vec3d w, ChainType type,
                const std::array<float, 2>* u, PathState<C>* path, Chain* chain) {
  if (!LeaveVertex(c, vertex, w, path, chain)) return false;
  RawHit hit;
  std::optional<SurfaceVertex<C>> at;
  while (chain->type.count < type.count) {
    if (MeetSurface(c, u, path, &hit, &at) != Met::kInterface) return false;
    const bool refracts = ((type.refractions >> chain->type.count) & 1u) != 0;
    const auto choose = [refracts](float) {
      return refracts ? ChainEvent::kRefract : ChainEvent::kReflect;
    };
    if (!PassInterface(c, *at, hit, choose, path, chain)) return false;
  }
  return true;
}

}  // namespace sheaf::render
