// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Subsurface walks: a path in the interior medium of a subsurface material is scattered until it
// intersects the boundary and is refracted out. The walk uses no diffusion model: its only errors
// are statistical. A walk counts as one bounce of the path, however long it is.
//
// Rays start at rounded points. If the mean free path is not long compared with that rounding, no
// ray can resolve the depth of the path, and the surface is flat at that scale: the walk then
// continues in double in front of the tangent plane, with the same distance samples, until it meets
// the plane or is far enough away for rays. The densest media so tend to their diffusion limit at
// any scale. See docs/adr/0023.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "worker/render/integrator/medium_boundaries.h"
#include "worker/render/integrator/point_in_medium.h"
#include "worker/render/integrator/russian_roulette.h"

namespace sheaf::render {

// Rays cannot follow mean free paths shorter than this multiple of the rounding of points.
inline constexpr float kFreePathOverErrorMin = 32;
// A surface is a plane up to this multiple of the rounding: 2^-15 of the camera's distance or so.
inline constexpr double kPlaneOverError = 128;

// Whether the walk is too fine for rays.
template <typename C>
bool IsWalkFine(const PathState<C>& path) {
  const float p_error = path.media.near.p_error;
  return path.media.properties.is_hidden && path.media.near.is_set &&
         MaxComponent(path.media.properties.sigma_t) * p_error * kFreePathOverErrorMin > 1;
}

// Whether the path meets the boundary of its subsurface medium. If so, path->ray.d becomes the
// direction of the walk.
template <typename C>
bool ArriveAtBoundary(const Surface& surface, PathState<C>* path) {
  if (path->subsurface.has_arrived) path->ray.d = path->subsurface.arrives_along;
  path->subsurface.has_arrived = false;
  return path->media.properties.is_subsurface && surface.encloses_subsurface;
}

// Starts a walk at a surface that the path has entered or not left.
template <typename C>
void StartSubsurfaceWalk(const SurfacePoint& point, PathState<C>* path) {
  path->media.near.p_error = ErrorAlongNormal(point);
  path->subsurface.offset = {};
  path->subsurface.is_near = IsWalkFine(*path);
}

// Continues a walk at a vertex with exact position `position`, which was rounded to p.
template <typename C>
void PlaceSubsurfaceVertex(Vec3d position, Vec3f p, PathState<C>* path) {
  const NearPlane& near = path->media.near;
  SubsurfaceState& walk = path->subsurface;
  const auto p_error = static_cast<double>(near.p_error);
  walk.offset = position - ToDouble(p);
  if (!IsWalkFine(*path)) return;
  const Vec3d n = ToDouble(near.n), from_plane = position - ToDouble(near.p);
  walk.is_near = Length(from_plane) < kPlaneOverError / 2 * p_error;
  if (walk.is_near) walk.offset = from_plane + n * std::max(0.0, -Dot(from_plane, n));
}

// Scatters the walk at a vertex next to its plane. *d: the direction, unit. False where it ends.
template <typename C>
bool ScatterNearPlane(const Context<C>& c, Vec3d d, PathState<C>* path) {
  using Color = typename C::Color;
  const PhaseMixture<Color> phase = c.scene.media->template PhaseOf<Color>(
      path->media.set, path->media.properties, path->throughput, path->wavelengths,
      path->media.subsurface_texture.OrNull());
  const std::array<float, 4> u = c.sampler.Get4(Slot(LastVertexIndex(*path), VertexSlot::kBsdf));
  const typename PhaseMixture<Color>::Sample sample =
      phase.SampleDirection(ToFloat(d), u[2], {u[0], u[1]});
  path->throughput *= sample.weight;
  if (path->throughput.IsBlack()) return false;
  CountScattering(c, *path, &path->media);
  path->specular = true;
  path->history.AddMedium(true);
  if constexpr (C::kGuided) path->guided.expected_light = 0;
  path->ray.d = sample.w;
  return SurvivesRoulette(c, u[3], path);
}

// Walks in front of the plane until the path meets it or is far away. False where the path ends.
// Requires: path->subsurface.is_near.
template <typename C>
bool WalkNearPlane(const Context<C>& c, PathState<C>* path) {
  using Color = typename C::Color;
  SubsurfaceState& walk = path->subsurface;
  const NearPlane& near = path->media.near;
  const MediumProperties<Color>& properties = path->media.properties;
  const Vec3d n = Normalize(ToDouble(near.n));
  const auto p_error = static_cast<double>(near.p_error);
  const double radius = kPlaneOverError * p_error;
  walk.is_near = false;
  Vec3d at = walk.offset;
  walk.offset = {};
  path->ray.source = {};
  path->ray.contact = path->ray.lead = 0;
  path->ray.own_offset = {};
  for (;;) {
    const Vec3d d = Normalize(ToDouble(path->ray.d));
    const double height = std::max(0.0, Dot(at, n)), descent = -Dot(d, n);
    const double to_plane =
        descent > 0 ? height / descent : std::numeric_limits<double>::infinity();
    const double along = Dot(at, d);
    const double to_radius =
        -along + std::sqrt(std::max(0.0, along * along + radius * radius - Dot(at, at)));
    DistanceUniforms u;
    if (properties.scatters) {
      u = MakeDistanceUniforms(c.sampler.Get4(Slot(NextVertexIndex(*path), VertexSlot::kMedium)),
                               0);
    }
    const DistanceSample<Color> distance_sample = SampleDistance<C::kChromaticMedia>(
        properties, std::min(to_plane, to_radius), u, path->throughput);
    path->throughput *= distance_sample.weight;
    if (path->throughput.IsBlack()) return false;
    // Steps without a scattering event count too, or the next one would draw the same numbers.
    if (!CountVertex(c, true, path)) return false;
    if (!distance_sample.scatters) {
      at += d * std::min(to_plane, to_radius);
      const double clear = 8 * p_error;  // From the plane, so that the ray starts in front of it.
      walk.has_arrived = to_plane <= to_radius;
      at += n * std::max(0.0, clear - Dot(at, n));
      path->ray.o = ToFloat(ToDouble(near.p) + at);
      if (walk.has_arrived) {
        walk.arrives_along = path->ray.d;
        path->ray.d = -near.n;
      }
      return true;
    }
    at += d * distance_sample.distance;
    if (!ScatterNearPlane(c, d, path)) return false;
  }
}

}  // namespace sheaf::render
