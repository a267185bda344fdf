// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathIntegrator: one sample of one pixel, by unidirectional path tracing with next-event
// estimation. Each vertex samples a light, and the scattered ray may hit a light; multiple
// importance sampling combines the two. Sources: Kajiya 1986; Veach 1997, ch. 8-10. Depth is
// counted as in pbrt-v4's path integrator: a path has at most max_depth scattering events, and
// emission seen directly has none.
//
// Compiled for each trait combination of variant_list.h. The tracer is a parameter, so that a
// benchmark can record the rays.
#pragma once

#include <array>
#include <cstdint>
#include <variant>

#include "common/film/film_tile.h"
#include "worker/render/integrator/context.h"
#include "worker/render/integrator/direct_lighting.h"
#include "worker/render/integrator/guided_directions.h"
#include "worker/render/integrator/next_vertex.h"
#include "worker/render/integrator/path_splits.h"
#include "worker/render/integrator/ray_sight.h"
#include "worker/render/integrator/training_pass.h"
#include "worker/render/integrator/volume_emission.h"

namespace sheaf::render {

struct GatherMap;

// One vertex, the same for surfaces and media: adds the light that it scatters back along the path,
// and samples the path's next ray. False where the path ends.
template <typename C, typename Vertex>
bool ScatterAt(const Context<C>& c, Vertex& vertex, PathState<C>* path, FilmSample* film) {
  // Record the first vertex for the film, and count the vertex.
  if (!vertex.Arrive(c, path, film)) return false;
  if (vertex.SamplesLights(*path)) {
    // Sample a light, and add what of it the vertex scatters back along the path.
    SampleLd(c, vertex, path);
    // The same through smooth interfaces.
    if constexpr (C::kChains && Vertex::kIsSurface) SampleChain(c, vertex, path);
    // Sample the emission of heterogeneous media likewise.
    if constexpr (C::kSamplesEmission) SampleVolumeEmission(c, vertex, path);
  }
  // Let further paths leave the vertex, where the field says that it pays.
  if constexpr (C::kGuided) SplitPathAt(c, vertex, path);
  // Sample the direction in which the path continues; Russian roulette may end it.
  return vertex.Scatter(c, path);
}

// Continues the path from the vertex where it has arrived. False where the path ends.
template <typename C>
bool ContinueFrom(const Context<C>& c, Vertex<C>* vertex, PathState<C>* path, FilmSample* film) {
  if (auto* surface = std::get_if<SurfaceVertex<C>>(vertex)) {
    return ScatterAt(c, *surface, path, film);
  }
  // Pass through surfaces that do not scatter.
  if (auto* null_interface = std::get_if<NullInterface>(vertex)) {
    return PassNullInterface(c, *null_interface, path);
  }
  if (std::holds_alternative<Escaped>(*vertex)) {
    // Nothing is hit: add infinite lights.
    AddInfiniteLe(c, path);
  } else if constexpr (C::kMedia) {
    if (auto* medium = std::get_if<MediumVertex<C>>(vertex)) {
      return ScatterAt(c, *medium, path, film);
    }
  }
  return false;
}

// In scenes whose shapes cast other shadows than rays see (RayVisibility::splits_shadow), the
// lights that a scattered ray hits are those of a ray that meets what shadow rays meet. Adds the
// emission of the light that a shadow ray in the path's direction reaches first, and of lights on
// the way that cast no shadow. Nothing where light sampling finds no light of the ray.
template <typename C>
void SearchLights(const Context<C>& c, PathState<C>* path) {
  if (!c.scene.visibility.splits_shadow || path->specular || path->rays.has_searched) return;
  PathState<C> search = *path;
  search.radiance = {};
  search.rays.searches = true;
  search.ray.mask = kLightSearch;
  Vertex<C> vertex;
  for (;;) {
    NextVertex(c, &search, &vertex);
    const auto* passed = std::get_if<NullInterface>(&vertex);
    if (passed == nullptr || !PassNullInterface(c, *passed, &search)) break;
  }
  if (std::holds_alternative<Escaped>(vertex)) AddInfiniteLe(c, &search);
  path->radiance += search.radiance;
  path->rays.has_searched = true;
}

// Follows the path to its end, adds the radiance that it finds to path->radiance, and records its
// first vertex in *film.
template <typename C>
void FollowPath(const Context<C>& c, PathState<C>* path, FilmSample* film) {
  Vertex<C> vertex;
  do {
    if constexpr (C::kRayKinds) SearchLights(c, path);
    // Trace the path's ray through media to its next vertex, and add emission met on the way.
    NextVertex(c, path, &vertex);
  } while (ContinueFrom(c, &vertex, path, film));
}

// The same with all paths that split off from it, one after the other: the last one first.
template <typename C>
void Li(const Context<C>& c, PathState<C>* path, FilmSample* film) {
  FollowPath(c, path, film);
  if constexpr (C::kGuided) {
    NotePathEnd(c, path->radiance);
    if (c.guiding.splits == nullptr) return;
    PathState<C> next;
    while (const uint32_t number = TakeWaiting(c, path->radiance, &next)) {
      const Sampler sampler = c.sampler.OfSplitPath(number);
      FollowPath(WithSampler(c, sampler), &next, film);
      path->radiance = next.radiance;
      NotePathEnd(c, path->radiance);
    }
  }
}

// The ray of the camera through a pixel, at a point that the filter chooses. Sets the sample's
// filter weight. *weight: as for Camera::MakeRay.
template <typename C>
Ray MakeCameraRay(const CompiledScene& scene, const Camera& camera,
                  const typename C::Sampler& sampler, std::array<int32_t, 2> pixel, float time,
                  FilmSample* film, float* weight) {
  Vec2f filter_u, lens_u;
  if constexpr (C::Has(Trait::kLens)) {
    const std::array<float, 4> u = sampler.Get4(Slot(CameraSlot::kFilterAndLens));
    filter_u = {u[0], u[1]};
    lens_u = {u[2], u[3]};
  } else {
    filter_u = sampler.Get2(Slot(CameraSlot::kFilterAndLens));
  }
  const FilterSample filtered = scene.filter.Sample(filter_u);
  film->filter_weight = filtered.weight;
  const Vec2d raster{pixel[0] + 0.5 + static_cast<double>(filtered.offset.x),
                     pixel[1] + 0.5 + static_cast<double>(filtered.offset.y)};
  return camera.template MakeRay<C::kTraits>(raster, lens_u, time, weight);
}

template <TraitBits kTraits, typename Tracer, DirectLight kDirectLight = DirectLight::kByBoth,
          PathKind kPathKind = PathKind::kCamera>
class PathIntegrator {
 public:
  using C = IntegratorConfig<kTraits, Tracer, kDirectLight, kPathKind>;

  // All three must outlive *this. Not thread-safe: one for each thread.
  PathIntegrator(const CompiledScene& scene, Tracer& tracer, RayCounts& counts)
      : scene_(scene), tracer_(tracer), counts_(counts) {
    SetFields(scene.guiding ? scene.guiding->fields() : nullptr);
  }

  // A pure function of (scene, pixel, sample_index).
  FilmSample TraceSample(int32_t x, int32_t y, uint64_t sample_index) {
    PathState<C> path;
    return Trace(Sampler(scene_.settings.seed, x, y, sample_index, scene_.settings.one_sequence), x,
                 y, &path);
  }
  // The sample of the pixel whose numbers are those of the sampler.
  FilmSample TraceBy(const typename C::Sampler& sampler, int32_t x, int32_t y) {
    PathState<C> path;
    return Trace(sampler, x, y, &path);
  }
  // Traces a path of a training: a pure function of the scene, the fields, the pass and the path's
  // number. Gives what it found to the sink. Requires: C::kKnowsLights.
  void TraceForTraining(const TrainingPass& pass, uint64_t number, const LearnedFields& fields,
                        GuidingSink* sink);
  // Traces the camera path of the pixel and pass through specular vertices, and stores its first
  // rough one: gather_row.h. Requires: kPathKind is kCameraBesideLight.
  void Gather(int32_t x, int32_t y, uint64_t pass, GatherMap* map);
  // Where TraceSample writes the other outputs that the settings request; the caller clears it.
  // Variants without kOutputs write nothing.
  void set_outputs(OutputSample* outputs) {
    outputs_ = outputs;
    groups_.Reset(scene_.settings.outputs);
  }

 private:
  // fields: null where nothing has been learned.
  void SetFields(const LearnedFields* fields) {
    emission_ = EmissionBy<C>(scene_, fields);
    if constexpr (C::kKnowsLights) guiding_.fields = fields;
    if constexpr (C::kGuided) {
      const bool splits = fields != nullptr && !fields->contributions.empty();
      guiding_.splits = splits ? &splits_ : nullptr;
    }
  }
  // *path: new.
  FilmSample Trace(const typename C::Sampler& sampler, int32_t x, int32_t y, PathState<C>* path);
  Ray CameraRay(const typename C::Sampler& sampler, int32_t x, int32_t y, float time,
                FilmSample* film, float* weight) const {
    return MakeCameraRay<C>(scene_, scene_.camera, sampler, {x, y}, time, film, weight);
  }

  const CompiledScene& scene_;
  Tracer& tracer_;
  RayCounts& counts_;
  OutputSample* outputs_ = nullptr;
  LightGroups<typename C::Color> groups_;
  [[no_unique_address]] StateIf<C::kKnowsLights, Guiding<C>> guiding_;
  [[no_unique_address]] StateIf<C::kBothEnds, GuidedEmission> emission_;
  [[no_unique_address]] StateIf<C::kGuided, SplitPaths<C>> splits_;
};

template <TraitBits kTraits, typename Tracer, DirectLight kDirectLight, PathKind kPathKind>
void PathIntegrator<kTraits, Tracer, kDirectLight, kPathKind>::TraceForTraining(
    const TrainingPass& pass, uint64_t number, const LearnedFields& fields, GuidingSink* sink) {
  static_assert(C::kKnowsLights);
  SetFields(&fields);
  TrainingRecords<C> records(guiding_.splits != nullptr);
  guiding_.training = &records;
  const auto [x, y] = pass.PixelOf(number);
  const uint64_t rays_before = counts_.rays;
  PathState<C> path;
  Trace(pass.SamplerOf(number), x, y, &path);
  guiding_.training = nullptr;
  records.GiveTo(sink);
  sink->AddPath(x, y, MeanRadiance(path.radiance), counts_.rays - rays_before);
}

template <TraitBits kTraits, typename Tracer, DirectLight kDirectLight, PathKind kPathKind>
FilmSample PathIntegrator<kTraits, Tracer, kDirectLight, kPathKind>::Trace(
    const typename C::Sampler& sampler, int32_t x, int32_t y, PathState<C>* path) {
  const Context<C> context{scene_,   tracer_, sampler,  counts_,
                           outputs_, groups_, guiding_, emission_};
  FilmSample film;
  float weight = 1;
  const float time = C::Has(Trait::kMotion)
                         ? scene_.camera.ShutterFraction(sampler.Get1(Slot(CameraSlot::kTime)))
                         : 0;
  path->ray = CameraRay(sampler, x, y, time, &film, &weight);
  path->camera_o = scene_.camera.EyeOf(path->ray);
  BeginRay(RayKind::kCamera, path);
  if constexpr (C::kGuided) {
    if (guiding_.splits != nullptr) {
      splits_.Begin(sampler, guiding_.fields->contributions.PixelFactor(x, y));
    }
  }
  // Rays that the lens blocks are black samples.
  if (C::Has(Trait::kLens) && weight == 0) return film;
  if constexpr (C::Has(Trait::kEnvironment)) path->from = path->ray.o;
  if constexpr (C::kSpectral) {
    path->wavelengths = scene_.wavelengths.Sample(sampler.Get1(Slot(CameraSlot::kWavelength)));
  }
  if constexpr (C::kMedia) StartInMedia(context, path);
  bool begins = true;
  if constexpr (C::kRayKinds) begins = StartAtNearClip(context, path);
  if (begins) Li(context, path, &film);
  film.radiance = scene_.film.Of(path->radiance, path->wavelengths);
  if constexpr (C::Has(Trait::kLens)) film.radiance *= weight;
  scene_.film.Clamp(&film.radiance, &weight);
  if constexpr (C::kOutputs) {
    groups_.MoveTo(outputs_, [&](const typename C::Color& sum) {
      return scene_.film.Of(sum, path->wavelengths) * weight;
    });
  }
  return film;
}

}  // namespace sheaf::render
