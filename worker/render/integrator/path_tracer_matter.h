// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, the part beneath surfaces that light goes through: a walk in the matter of a
// subsurface material, scattering by scattering, until it comes to the boundary and is bent out of
// it. No model of what comes out where: its only errors are those of chance. A walk is one bounce
// of a path however long it is. Included by path_tracer.h.
//
// Rays start at rounded points. Where a free path is not long against that rounding, no ray could
// tell how deep a path is, and what is small against the rounding is flat: there the path goes on
// in double before the plane of the surface, by the same free flights, until it meets the plane or
// has gone far enough for rays. So the densest matter tends to its diffuse limit, at any scale.
// See docs/adr/0023.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

// Shorter than so many times the rounding of places is a free path that rays cannot follow.
inline constexpr float kFreePathOverErrorMin = 32;
// A surface is a plane up to so many times the rounding: some 2^-15 of the camera's distance.
inline constexpr double kPlaneOverError = 128;

// Of a surface point along its normal.
inline float ErrorAlongNormal(const SurfacePoint& point) {
  const Vec3f n = Abs(point.ng);
  return std::max(Dot(n, point.p_error), Gamma(2) * Dot(n, Abs(point.p)));
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::IsFine(const Path& path) {
  const float p_error = path.media.near.p_error;
  return path.media.mix.is_hidden && path.media.near.is_set &&
         MaxComponent(path.media.mix.sigma_t) * p_error * kFreePathOverErrorMin > 1;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::ArriveInMatter(const Surface& surface, Path* path) {
  if (path->matter.has_arrived) path->ray.d = path->matter.arrives_along;
  path->matter.has_arrived = false;
  return path->media.mix.is_matter && surface.encloses_matter;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::StartAtBoundary(const SurfacePoint& point,
                                                                Path* path) {
  path->media.near.p_error = ErrorAlongNormal(point);
  path->matter.offset = {};
  path->matter.is_near = IsFine(*path);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::PlaceInMatter(Vec3d place, Vec3f p, Path* path) {
  const NearPlane& near = path->media.near;
  InMatter& matter = path->matter;
  const auto p_error = static_cast<double>(near.p_error);
  matter.offset = place - ToDouble(p);
  if (!IsFine(*path)) return;
  const Vec3d n = ToDouble(near.n), from_plane = place - ToDouble(near.p);
  matter.is_near = Length(from_plane) < kPlaneOverError / 2 * p_error;
  if (matter.is_near) matter.offset = from_plane + n * std::max(0.0, -Dot(from_plane, n));
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::WalkNearPlane(const Sampler& sampler, Path* path) {
  InMatter& matter = path->matter;
  const NearPlane& near = path->media.near;
  const MediumMix<Color>& mix = path->media.mix;
  const Vec3d n = Normalize(ToDouble(near.n));
  const auto p_error = static_cast<double>(near.p_error);
  const double radius = kPlaneOverError * p_error;
  matter.is_near = false;
  Vec3d at = matter.offset;
  matter.offset = {};
  path->ray.source = {};
  for (;;) {
    const Vec3d d = Normalize(ToDouble(path->ray.d));
    const double height = std::max(0.0, Dot(at, n)), falls = -Dot(d, n);
    const double to_plane = falls > 0 ? height / falls : std::numeric_limits<double>::infinity();
    const double along = Dot(at, d);
    const double to_radius =
        -along + std::sqrt(std::max(0.0, along * along + radius * radius - Dot(at, at)));
    FlightNumbers u;
    if (mix.scatters) {
      u = MakeFlightNumbers(sampler.Get4(Slot(NextVertex(*path), VertexSlot::kMedium)), 0);
    }
    const Flight<Color> flight =
        SampleFlight<kChromaticMedia>(mix, std::min(to_plane, to_radius), u, path->throughput);
    path->throughput *= flight.weight;
    if (path->throughput.IsBlack()) return false;
    if (!flight.scatters) {
      // A step of its own, or the next flight would draw the same numbers.
      if (!CountVertex(true, path)) return false;
      at += d * std::min(to_plane, to_radius);
      const double clear = 8 * p_error;  // From the plane, for the ray not to begin behind it.
      matter.has_arrived = to_plane <= to_radius;
      at += n * std::max(0.0, clear - Dot(at, n));
      path->ray.o = ToFloat(ToDouble(near.p) + at);
      if (matter.has_arrived) {
        matter.arrives_along = path->ray.d;
        path->ray.d = -near.n;
      }
      return true;
    }
    at += d * flight.distance;
    if (!CountVertex(true, path)) return false;
    const PhaseMix<Color> phase = scene_.media->template PhaseOf<Color>(
        path->media.set, mix, path->throughput, path->wavelengths, path->media.paint.OrNull());
    const std::array<float, 4> v = sampler.Get4(Slot(LastVertex(*path), VertexSlot::kBsdf));
    const typename PhaseMix<Color>::Sample sample =
        phase.SampleDirection(ToFloat(d), v[2], {v[0], v[1]});
    path->throughput *= sample.weight;
    if (path->throughput.IsBlack()) return false;
    CountScattering(*path, &path->media);
    path->specular = true;
    path->history.AddMedium(true);
    path->ray.d = sample.w;
    if (!SurvivesRoulette(v[3], path)) return false;
  }
}

}  // namespace sheaf::render
