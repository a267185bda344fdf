// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GatherRow: stores the camera paths of one row that light paths of the pass are merged with, for
// the generated files that compile the variants.
#pragma once

#include <variant>

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/gather/gather_map.h"
#include "worker/render/integrator/path_integrator.h"
#include "worker/render/integrator/variants.h"

namespace sheaf::render {

// Changes the seed of the sampler, so that stored camera paths are independent of camera samples.
inline constexpr uint64_t kGatherSeed = 0x6761746865727078u;

// Follows the path through specular vertices. Null where it ends, or light paths are not merged
// with it.
template <typename C>
const SurfaceVertex<C>* FollowToMerge(const Context<C>& c, PathState<C>* path, Vertex<C>* vertex) {
  FilmSample unused;
  for (;;) {
    NextVertex(c, path, vertex);
    if (auto* at = std::get_if<SurfaceVertex<C>>(vertex)) {
      if (!at->Arrive(c, path, &unused)) return nullptr;
      if (path->other_end.merge_radius > 0) return at;
      if (!path->other_end.is_in_prefix || !at->Scatter(c, path)) return nullptr;
    } else if (auto* null_interface = std::get_if<NullInterface>(vertex)) {
      if (!CrossNullInterface(c, null_interface->point, path)) return nullptr;
    } else {
      return nullptr;
    }
  }
}

template <TraitBits kTraits, typename Tracer, DirectLight kDirectLight, PathKind kPathKind>
void PathIntegrator<kTraits, Tracer, kDirectLight, kPathKind>::Gather(int32_t x, int32_t y,
                                                                      uint64_t pass,
                                                                      GatherMap* map) {
  const Sampler sampler(scene_.settings.seed ^ kGatherSeed, x, y, pass,
                        scene_.settings.one_sequence);
  const Context<C> context{scene_,  tracer_, sampler,  counts_,
                           nullptr, groups_, guiding_, emission_};
  PathState<C> path;
  FilmSample film;
  float weight = 1;
  const float time = C::Has(Trait::kMotion) ? scene_.camera.ShutterFraction(map->sample.time) : 0;
  path.ray = CameraRay(sampler, x, y, time, &film, &weight);
  path.camera_o = scene_.camera.EyeOf(path.ray);
  if (C::Has(Trait::kLens) && weight == 0) return;
  if constexpr (C::Has(Trait::kEnvironment)) path.from = path.ray.o;
  if constexpr (C::kSpectral) {
    path.wavelengths = scene_.wavelengths.Sample(map->sample.wavelengths);
  }
  if constexpr (C::kMedia) StartInMedia(context, &path);
  Vertex<C> vertex;
  const SurfaceVertex<C>* at = FollowToMerge(context, &path, &vertex);
  if (at == nullptr) return;
  GatherPointOf<typename C::Color> stored;
  at->Store(&stored);
  stored.throughput = path.throughput * (film.filter_weight * weight);
  stored.x = x;
  stored.y = y;
  stored.depth = path.depth;
  stored.weight_radius = path.other_end.merge_radius;
  stored.secondary_terminated = path.secondary_terminated;
  map->arena.Add({at->point.p, stored.weight_radius * map->radius_scale}, stored);
}

template <TraitBits kTraits>
void GatherRow(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y, uint64_t pass,
               GatherMap* map, RayCounts* counts) {
  RayCounts local;
  local.majorant_factor = counts->majorant_factor;
  PathIntegrator<kTraits, const EmbreeScene, DirectLight::kByBoth, PathKind::kCameraBesideLight>
      tracer(scene, *scene.tracer, local);
  for (int32_t x = x0; x < x1; ++x) {
    const int64_t pixel = x + int64_t{y} * scene.settings.width_px;
    if (GathersAt(scene.settings.seed, pixel, pass, scene.gather_step)) {
      tracer.Gather(x, y, pass, map);
    }
  }
  counts->Add(local);
}

}  // namespace sheaf::render
