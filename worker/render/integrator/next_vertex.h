// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// NextVertex: follows a path's ray to its next vertex, and adds the emission met on the way: that
// of media along the segment, and that of the surface at its end.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>
#include <variant>

#include "worker/render/integrator/direct_lighting.h"
#include "worker/render/integrator/medium_vertex.h"
#include "worker/render/integrator/ray_sight.h"
#include "worker/render/integrator/surface_vertex.h"
#include "worker/render/integrator/transmittance.h"
#include "worker/render/integrator/volume_emission.h"

namespace sheaf::render {

// The path ends: no light can come by a longer one, or its nesting of media is broken.
struct Terminated {};
// The ray hits nothing.
struct Escaped {};
// The ray passes through a surface.
struct NullInterface {
  SurfacePoint point;
  bool is_unseen = false;  // The path stays in its media.
};
template <typename C>
using Vertex = std::conditional_t<
    C::kMedia, std::variant<Terminated, Escaped, NullInterface, SurfaceVertex<C>, MediumVertex<C>>,
    std::variant<Terminated, Escaped, NullInterface, SurfaceVertex<C>>>;

enum class SegmentEnd : uint8_t { kHit, kScattered, kTerminated };

// Takes the path through its media up to `hit` (null: to its end, see FarClipOf), or to where they
// scatter it: then sets *vertex. Adds the segment's emission and its line-sampled light. flight:
// what is known of it before.
template <typename C>
SegmentEnd SampleMediumSegment(const Context<C>& c, const RawHit* hit, const FlightIf<C>& flight,
                               PathState<C>* path, Vertex<C>* vertex) {
  using Color = typename C::Color;
  MediumState<C>& media = path->media;
  const double end = FarClipOf(c, *path);
  const bool is_clipped = C::kRayKinds && end < std::numeric_limits<double>::infinity();
  if constexpr (C::kNested) {
    if (hit == nullptr && !is_clipped && !media.interiors.empty()) {
      ++c.counts.broken_nestings;
      return SegmentEnd::kTerminated;
    }
  }
  if (media.set.empty()) return SegmentEnd::kHit;
  if constexpr (C::kSubsurface) {
    if (path->subsurface.has_arrived && hit != nullptr) return SegmentEnd::kHit;
  }
  if (hit == nullptr && !is_clipped && media.properties.is_bounded && !Scatters<C>(flight)) {
    ++c.counts.broken_nestings;
    return SegmentEnd::kTerminated;
  }
  const double unit = Length(ToDouble(path->ray.d));
  double length = hit == nullptr ? end * unit : static_cast<double>(hit->t) * unit;
  const bool is_exact = NeedsExactPlace<C>(media, path->ray);
  if (is_exact) length = ExactLength(media.near, path->ray, length);
  if constexpr (C::Has(Trait::kEmissiveMedia) && !C::kFromLight) {
    if (!SearchesLights(*path)) AddSegmentEmission(c, length, path);
  }
  [[maybe_unused]] StateIf<C::kLines, LineOf<C>> line;
  if constexpr (C::kLines) {
    if (UsesLineSampling<C>(media.properties) && !SearchesLights(*path)) {
      line = MakeLine(c, *path, length);
      SampleLdOnLine(c, line, length, hit, path);
    }
  }
  MediumScatterer scatterer;
  const DistanceSample<Color> distance_sample = [&] {
    if constexpr (C::kHeterogeneous) {
      if (flight.is_known && (hit == nullptr || IsUneventful(flight))) {
        scatterer = flight.scatterer;
        return flight.sample;
      }
      if (media.properties.is_heterogeneous) {
        return SampleDistanceHeterogeneous(
            c, path->ray, c.sampler.Get4(Slot(NextVertexIndex(*path), VertexSlot::kMedium)), length,
            *path, &scatterer);
      }
    }
    DistanceUniforms u;
    if (media.properties.scatters) {
      u = MakeDistanceUniforms(c.sampler.Get4(Slot(NextVertexIndex(*path), VertexSlot::kMedium)),
                               path->null_crossings);
    }
    return SampleDistance<C::kChromaticMedia>(media.properties, length, u, path->throughput);
  }();
  path->throughput *= distance_sample.weight;
  if (path->throughput.IsBlack()) return SegmentEnd::kTerminated;
  if (!distance_sample.scatters) {
    if constexpr (C::kSubsurface) path->subsurface.offset = {};
    return SegmentEnd::kHit;
  }
  if constexpr (C::kLines) RecordLineScattering(c, line, distance_sample.distance, scatterer, path);
  const double t = distance_sample.distance / unit;
  const Vec3f p = is_exact ? ExactPointInMedium(c, path->ray, hit, distance_sample.distance, length,
                                                &media.near)
                           : PointInMedium(c, path->ray, hit, t, &media.near);
  if (!is_exact) media.near.has_offset = false;
  // In thin media without end. No light is farther away.
  if (!IsTraced(p)) return SegmentEnd::kTerminated;
  vertex->template emplace<MediumVertex<C>>(p, t, scatterer);
  return SegmentEnd::kScattered;
}

// Evaluates the surface that the path's ray hits. Sets *vertex.
template <typename C>
void ResolveSurface(const Context<C>& c, const RawHit& hit, PathState<C>* path, Vertex<C>* vertex) {
  auto& at = vertex->template emplace<SurfaceVertex<C>>(c, hit, *path);
  const Surface& surface = *at.point.surface;
  if constexpr (C::kSubsurface) at.in_subsurface = ArriveAtBoundary(surface, path);
  if constexpr (C::kRayKinds) {
    if (IsUnseen(c, at.point, path->ray.d, BoundaryRayOf(*path), path->media)) {
      const SurfacePoint point = at.point;
      vertex->template emplace<NullInterface>(point, true);
      return;
    }
  }
  at.choice = NullInterfaceChoiceAt(c, surface, *path);
  bool is_null = IsCutOut(c, at.point, at.choice.cut_out);
  if (!is_null) {
    if constexpr (C::Has(Trait::kAreaLights) && !C::kFromLight) {
      if (at.point.emitter != kNoEmitter) AddEmittedLe(c, at.point, path);
    }
    if constexpr (C::kRayKinds) {
      if (path->rays.searches && (surface.seen_by & kShadowRay) == 0) {
        const SurfacePoint point = at.point;
        vertex->template emplace<NullInterface>(point);
        return;
      }
    }
    // The last vertex needs no BSDF, unless it may turn out to be a null interface.
    if (path->depth == static_cast<uint32_t>(c.scene.settings.max_depth) && !path->is_camera_path &&
        !at.in_subsurface && !(C::kNullInterfaces && surface.may_pass)) {
      vertex->template emplace<Terminated>();
      return;
    }
    at.bsdf = c.scene.materials->template Evaluate<C::kTraits>(
        surface.material, TexturePointOf(c, at.point), at.choice.mix, path->wavelengths);
    is_null = C::kNullInterfaces && at.bsdf.kind == BsdfKind::kInterface;
    if constexpr (C::kNested) {
      const BoundaryKind kind = ResolveInterior(c, at.point, *path, &at.bsdf);
      if (kind == BoundaryKind::kBroken) {
        vertex->template emplace<Terminated>();
        return;
      }
      is_null = is_null || kind == BoundaryKind::kHidden;
    }
  }
  if (is_null) {
    const SurfacePoint point = at.point;
    vertex->template emplace<NullInterface>(point);
    return;
  }
  at.Prepare(c, -path->ray.d);
}

// Makes a ray that began before the place it leaves begin there, now that it is traced.
inline void AdvanceToPlace(Ray* ray, RawHit* hit) {
  const double t = static_cast<double>(ray->lead) / Length(ToDouble(ray->d));
  ray->o = ToFloat(ToDouble(ray->o) + ToDouble(ray->d) * t);
  hit->t = std::max(0.0f, static_cast<float>(static_cast<double>(hit->t) - t));
  ray->contact = ray->lead = 0;
}

// Sets *vertex to the next vertex of the path.
template <typename C>
void NextVertex(const Context<C>& c, PathState<C>* path, Vertex<C>* vertex) {
  if constexpr (C::kSubsurface) {
    if (path->subsurface.is_near && !WalkNearPlane(c, path)) {
      vertex->template emplace<Terminated>();
      return;
    }
  }
  ++c.counts.rays;
  RawHit hit;
  [[maybe_unused]] FlightIf<C> flight;
  [[maybe_unused]] const float t_max = path->ray.t_max;
  if constexpr (C::kHeterogeneous) flight = FlyAhead(c, path);
  bool hits = c.tracer.Intersect(path->ray, &hit);
  if constexpr (C::kHeterogeneous) path->ray.t_max = t_max;
  if (path->ray.contact > 0) [[unlikely]]
    AdvanceToPlace(&path->ray, &hit);
  if constexpr (C::kRayKinds) hits = hits && static_cast<double>(hit.t) < FarClipOf(c, *path);
  if constexpr (C::kMedia) {
    const SegmentEnd end = SampleMediumSegment(c, hits ? &hit : nullptr, flight, path, vertex);
    if (end == SegmentEnd::kTerminated) vertex->template emplace<Terminated>();
    if (end != SegmentEnd::kHit) return;
  }
  if (!hits) {
    vertex->template emplace<Escaped>();
    return;
  }
  ResolveSurface(c, hit, path, vertex);
}

// Continues the path's ray behind a null interface. False where the path ends.
template <typename C>
bool CrossNullInterface(const Context<C>& c, const SurfacePoint& point, PathState<C>* path) {
  if (++path->null_crossings > kNullCrossingsMax) {
    ++c.counts.long_segments;
    return false;
  }
  if constexpr (C::kChains) {
    // Chains pass only through surfaces that never scatter there.
    const Surface& surface = *point.surface;
    const bool is_hidden = C::kNested && surface.rank != kNoRank;
    if (surface.has_alpha || (surface.may_pass && !is_hidden)) path->chain.Close();
  }
  if constexpr (C::kMedia) {
    if (!CrossBoundary(c, point, path->ray.d, *path, &path->media)) return false;
  }
  Leave(point, path->ray.d, &path->ray);
  return true;
}

// The same behind a surface that the path may not see.
template <typename C>
bool PassNullInterface(const Context<C>& c, const NullInterface& passed, PathState<C>* path) {
  if constexpr (C::kRayKinds) {
    if (passed.is_unseen) {
      if (++path->null_crossings > kNullCrossingsMax) {
        ++c.counts.long_segments;
        return false;
      }
      PassUnseen<C>(passed.point, &path->ray, &path->media);
      return true;
    }
  }
  return CrossNullInterface(c, passed.point, path);
}

// Takes the ray of the camera to the near plane, past what lies before it, in the media that it
// then is in. False where their nesting is broken.
template <typename C>
bool StartAtNearClip(const Context<C>& c, PathState<C>* path) {
  const Camera& camera = c.scene.camera;
  if (!camera.HasNearClip()) return true;
  Ray& ray = path->ray;
  if constexpr (C::kMedia) {
    RawHit hit;
    while (c.scene.media) {
      ++c.counts.rays;
      if (!c.tracer.Intersect(ray, &hit)) break;
      if (ray.contact > 0) AdvanceToPlace(&ray, &hit);
      if (static_cast<double>(hit.t) >= camera.NearClip(ray)) break;
      const SurfacePoint point = MakeSurfacePoint<C::kTraits>(c.scene.geometry, ray, hit);
      const bool is_unseen = IsUnseen(c, point, ray.d, BoundaryRayOf(*path), path->media);
      if (!PassNullInterface(c, {point, is_unseen}, path)) return false;
    }
    path->null_crossings = 0;
    path->media.near = {};
  }
  Ray start;
  start.o = ToFloat(ToDouble(ray.o) + ToDouble(ray.d) * std::max(0.0, camera.NearClip(ray)));
  start.d = ray.d;
  start.time = ray.time;
  start.mask = ray.mask;
  ray = start;
  return true;
}

}  // namespace sheaf::render
