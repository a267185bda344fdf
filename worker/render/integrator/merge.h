// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Merge: a path from a light that arrives near the stored vertices of camera paths is taken to
// arrive at each of them: their light is estimated by the density of what arrives. Weights combine
// that with the techniques of the camera's paths (two_ends.h). Sources: Georgiev et al. 2012;
// Hachisuka et al. 2008, "Progressive Photon Mapping"; docs/adr/0130.
#pragma once

#include <cmath>
#include <cstdint>

#include "worker/render/gather/gather_map.h"
#include "worker/render/integrator/splat_sink.h"
#include "worker/render/integrator/surface_vertex.h"
#include "worker/render/integrator/two_ends.h"

namespace sheaf::render {

// The layers of light that a light path brings to the film.
struct SplatLayers {
  LightPathKind kind{};
  uint32_t group = 0;
};
template <typename C, typename Vertex>
SplatLayers LayersOf([[maybe_unused]] const Context<C>& c, [[maybe_unused]] const Vertex& vertex,
                     [[maybe_unused]] const PathState<C>& path) {
  SplatLayers layers;
  if constexpr (C::kOutputs) {
    const FilmOutputs& outputs = c.scene.settings.outputs;
    if (outputs.light_paths) {
      layers.kind = KindFromLight(vertex, path);
    } else if (!outputs.light_groups.empty()) {
      layers.group = path.other_end.is_medium ? c.scene.media_group
                                              : c.scene.lights->GroupOf(path.other_end.light);
    }
  }
  return layers;
}

// The part of a merge's radiance that it adds to the estimate of its bias: for light that varies
// smoothly, bias grows with the square of the radius r, and is 4/3 (E(r) - E(r / 2)).
constexpr float BiasShare(bool is_within_half) {
  constexpr float kScale = 4.0f / 3;
  return is_within_half ? kScale * (1 - 4) : kScale;
}

// The path's arrival at a surface, as merging needs it.
template <typename C>
struct Arrival {
  Vec3f d;       // Unit.
  float cosine;  // |cos| of d to the surface.
  Vec3f facing;  // The surface's normal, against d.

  Arrival(const SurfacePoint& point, const PathState<C>& path) : d(Normalize(path.ray.d)) {
    const float signed_cosine = Dot(d, point.ng);
    cosine = std::fabs(signed_cosine);
    facing = signed_cosine < 0 ? point.ng : -point.ng;
  }
};

// Whether both lie on the same side of what may be one surface, and the whole path is short enough.
template <typename C>
bool MayMeet(const Context<C>& c, const Arrival<C>& arrival,
             const GatherPointOf<typename C::Color>& stored, const PathState<C>& path) {
  // Both count the vertex.
  if (stored.depth + path.depth > static_cast<uint32_t>(c.scene.settings.max_depth) + 1) {
    return false;
  }
  const float cosine = Dot(arrival.d, stored.ng);
  if (cosine * static_cast<float>(stored.light_side) > 0) return false;
  const Vec3f facing = cosine < 0 ? stored.ng : -stored.ng;
  return Dot(facing, arrival.facing) > kMergeNormalCosineMin;
}

// Merges the path with one stored point.
template <typename C>
void MergeWith(const Context<C>& c, const SurfaceVertex<C>& vertex, const PathState<C>& path,
               const Arrival<C>& arrival, const GatherPointOf<typename C::Color>& stored,
               float radius, float distance_squared, SplatSink* splats) {
  using Color = typename C::Color;
  const SurfaceVertex<C> at(c, vertex.point.p, stored);
  const BsdfValueOf<Color> value = at.Eval(-arrival.d);
  if (value.f_cos.IsBlack()) return;
  if (arrival.cosine < kGrazingCosineMin) {
    ++c.counts.grazing_merges;
    return;
  }
  // The shading cosine is in f_cos; what arrives is per area of the surface.
  const auto r = static_cast<double>(radius);
  const double area = kPi * r * r * static_cast<double>(arrival.cosine);
  double factor =
      path.other_end.scale * c.scene.gather_step / (area * c.scene.light_paths_per_pass);
  // Each of the two paths gave the primary wavelength the weight of all.
  if (stored.secondary_terminated && path.secondary_terminated) factor /= kWavelengthCount;
  const Color found =
      stored.throughput * path.throughput * value.f_cos * static_cast<float>(factor);
  const Rgb unweighted = c.scene.film.Of(found, path.wavelengths);
  const double stored_cosine = std::fabs(static_cast<double>(Dot(arrival.d, stored.ng)));
  const double camera_paths = CameraPathsAtMerge(
      c, static_cast<double>(value.pdf), stored.weight_radius, stored_cosine, stored.depth, path);
  float weight = ConnectionWeight(c, camera_paths);
  if (splats->wants_moments()) {
    splats->AddMoment({stored.x + 0.5, stored.y + 0.5}, unweighted, static_cast<double>(weight),
                      camera_paths, InterfacesOfChain(path.other_end));
  }
  Rgb radiance = unweighted * weight;
  c.scene.film.Clamp(&radiance, &weight);
  const SplatLayers layers = LayersOf(c, vertex, path);
  const float bias_share = BiasShare(distance_squared < 0.25f * radius * radius);
  splats->AddMerged(stored.x, stored.y, radiance, radiance * bias_share, layers.kind, layers.group);
}

// Merges the path, which has arrived at the vertex, with all that are near.
template <typename C>
void Merge(const Context<C>& c, const SurfaceVertex<C>& vertex, const PathState<C>& path,
           const GatherMap& map, SplatSink* splats) {
  const Surface& surface = *vertex.point.surface;
  if (surface.may_pass || surface.has_alpha || vertex.in_subsurface) return;
  const Arrival<C> arrival(vertex.point, path);
  map.grid.ForEachAround(vertex.point.p, [&](uint32_t index, float distance_squared) {
    const auto& stored = map.arena.At<typename C::Color>(index);
    if (!MayMeet(c, arrival, stored, path)) return;
    MergeWith(c, vertex, path, arrival, stored, stored.weight_radius * map.radius_scale,
              distance_squared, splats);
  });
}

}  // namespace sheaf::render
