// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightPathIntegrator: paths that begin at lights. Each vertex is connected to the camera, and its
// light added to the film where the camera sees it; the scattered ray continues. Weights combine
// that with the techniques of the camera's paths (two_ends.h). Source: Dutre, Lafortune and Willems
// 1993, "Monte Carlo Light Tracing with Direct Computation of Pixel Intensities"; Veach 1997, ch.
// 10; docs/adr/0063.
//
// Light that the camera sees directly, or by specular scattering alone, is not found.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>

#include "common/film/film_tile.h"
#include "worker/render/guiding/emission_statistics.h"
#include "worker/render/integrator/light_start.h"
#include "worker/render/integrator/merge.h"
#include "worker/render/integrator/next_vertex.h"
#include "worker/render/integrator/splat_sink.h"
#include "worker/render/integrator/training_pass.h"
#include "worker/render/integrator/two_ends.h"

namespace sheaf::render {

// --- Connections to the camera -------------------------------------------------------------------

// The transmittance from the vertex to the lens; black where it is hidden. Where the vertex seeks a
// line, *line becomes LineOverSample of the camera's segment.
template <typename C, typename Vertex>
typename C::Color TransmittanceToLens(const Context<C>& c, const Vertex& vertex,
                                      const CameraConnection& seen, std::array<float, 2> u,
                                      const PathState<C>& path, double* line) {
  using Color = typename C::Color;
  const SurfacePoint& point = vertex.point;
  Ray ray;
  ray.time = path.ray.time;
  Leave(point, seen.wi, &ray);
  ray.d = seen.p_lens - ray.o;
  ray.t_max = 1;
  ray.end = Ray::End::kFree;
  if constexpr (C::kMedia) {
    MediumState<C> media = path.media;
    if (!vertex.EnterSide(c, seen.wi, path, &media)) return {};
    if constexpr (C::kCountsLines && !Vertex::kIsSurface) {
      if (path.other_end.is_first && path.other_end.line.is_sought) {
        double length = 0;  // The segment's length.
        const Color transmittance = TraceTransmittance(
            c, ray, &seen.p_lens, u, path, std::move(media),
            [&](const Ray&, uint32_t crossing, double part, const Color&, const MediumState<C>&) {
              if (crossing == 0) length = part;
            });
        const Vec3d start = ToDouble(point.p) + length * ToDouble(seen.wi);
        if (!transmittance.IsBlack()) *line = LineOverSampleFrom(c, start, point.p, path);
        return transmittance;
      }
    }
    return TraceTransmittance(c, ray, &seen.p_lens, u, path, std::move(media), nullptr);
  } else if constexpr (C::kNullInterfaces) {
    return Color::Gray(IsVisibleThroughNullInterfaces(c, ray, &seen.p_lens, u) ? 1 : 0);
  } else {
    ++c.counts.rays;
    ++c.counts.shadow_rays;
    return Color::Gray(c.tracer.Occluded(ray) ? 0 : 1);
  }
}

// Adds the light that the vertex scatters to the camera.
template <typename C, typename Vertex>
void ConnectToCamera(const Context<C>& c, const Vertex& vertex, const PathState<C>& path,
                     SplatSink* splats) {
  using Color = typename C::Color;
  const std::array<float, 4> u = c.sampler.Get4(Slot(LastVertexIndex(path), VertexSlot::kLight));
  const std::optional<CameraConnection> seen =
      c.scene.camera.SampleWi(vertex.point.p, {u[0], u[1]}, path.ray.time);
  if (!seen || !(seen->importance > 0) || !splats->Covers(seen->film)) return;
  const BsdfValueOf<Color> value = vertex.SeenFrom(c, seen->wi).Eval(-path.ray.d);
  if (value.f_cos.IsBlack()) return;
  double line = 0;
  const Color transmittance = TransmittanceToLens(c, vertex, *seen, {u[3], u[2]}, path, &line);
  if (transmittance.IsBlack()) return;
  const auto flux = static_cast<double>(vertex.FluxFactor(seen->wi, path));
  const double camera_paths =
      CameraPathsAtLens(c, static_cast<double>(value.pdf), flux, seen->ray_density, path, line);
  float weight = ConnectionWeight(c, camera_paths);
  const auto factor = static_cast<float>(flux * seen->importance * path.other_end.scale);
  const Rgb unweighted =
      c.scene.film.Of(path.throughput * value.f_cos * transmittance * factor, path.wavelengths);
  const auto per_pass = static_cast<float>(1 / c.scene.light_paths_per_pass);
  if (splats->wants_moments()) {
    splats->AddMoment(seen->film, unweighted * per_pass, static_cast<double>(weight), camera_paths,
                      InterfacesOfChain(path.other_end));
  }
  Rgb radiance = unweighted * weight;
  c.scene.film.Clamp(&radiance, &weight);
  radiance *= per_pass;
  const SplatLayers layers = LayersOf(c, vertex, path);
  splats->Add(seen->film, radiance, layers.kind, layers.group);
}

// --- The path ------------------------------------------------------------------------------------

// The path arrives at the vertex. False where it ends. *is_rough: whether light is sampled there.
template <typename C, typename Vertex>
bool ArriveFromLight(const Context<C>& c, Vertex& vertex, PathState<C>* path, bool* is_rough) {
  FilmSample unused;
  MeetLine(c, vertex.point.p, path);
  if (!vertex.Arrive(c, path, &unused)) return false;
  *is_rough = vertex.SamplesLights(*path);
  if (!path->other_end.is_first) return true;
  if (!ArriveFirst(c, vertex, *is_rough, path)) return false;
  SeekLine(c, vertex, path);
  return true;
}

// One vertex, the same for surfaces and media. False where the path ends.
// map: what the path is merged with; may be null.
template <typename C, typename Vertex>
bool ScatterLightAt(const Context<C>& c, Vertex& vertex, PathState<C>* path, const GatherMap* map,
                    SplatSink* splats) {
  bool is_rough = false;
  if (!ArriveFromLight(c, vertex, path, &is_rough)) return false;
  if (is_rough) ConnectToCamera(c, vertex, *path, splats);
  if constexpr (std::is_same_v<Vertex, SurfaceVertex<C>>) {
    if (map != nullptr && is_rough) Merge(c, vertex, *path, *map, splats);
  }
  return vertex.ScatterFromLight(c, path);
}

// Follows the path to its end.
template <typename C>
void TraceLight(const Context<C>& c, PathState<C>* path, const GatherMap* map, SplatSink* splats) {
  Vertex<C> vertex;
  for (;;) {
    NextVertex(c, path, &vertex);
    bool continues = false;
    if (auto* surface = std::get_if<SurfaceVertex<C>>(&vertex)) {
      continues = ScatterLightAt(c, *surface, path, map, splats);
    } else if (auto* null_interface = std::get_if<NullInterface>(&vertex)) {
      MeetLine(c, null_interface->point.p, path);
      continues = CrossNullInterface(c, null_interface->point, path);
    } else if constexpr (C::kMedia) {
      if (auto* medium = std::get_if<MediumVertex<C>>(&vertex)) {
        continues = ScatterLightAt(c, *medium, path, map, splats);
      }
    }
    if (!continues) return;
  }
}

// --- Training ------------------------------------------------------------------------------------

// Where the path, which has just left its light, began.
template <typename C>
EmissionOrigin OriginOf(const Context<C>& c, const PathState<C>& path) {
  const LightEnd& end = path.other_end;
  const GuidedEmission& emission = c.emission;
  if (end.is_medium) {
    return emission.OriginOf(emission.lights().choice_count() - 1, {}, {}, {}, path.ray.d);
  }
  return emission.OriginOf(end.light, end.p, end.p, end.n, path.ray.d);
}

// Sums up the squares of what a path brings to the frame, as luminance.
class FrameSplats : public SplatSink {
 public:
  FrameSplats(int32_t width_px, int32_t height_px) : width_px_(width_px), height_px_(height_px) {}
  bool Covers(Vec2d raster) const override {
    return raster.x >= 0 && raster.y >= 0 && raster.x < width_px_ && raster.y < height_px_;
  }
  void Add(Vec2d, const Rgb& radiance, LightPathKind, uint32_t) override { AddSquare(radiance); }
  void AddMerged(int32_t, int32_t, const Rgb& radiance, const Rgb&, LightPathKind,
                 uint32_t) override {
    AddSquare(radiance);
  }
  double square() const { return square_; }

 private:
  void AddSquare(const Rgb& radiance) {
    const auto luminance = static_cast<double>(Luminance(radiance));
    square_ += luminance * luminance;
  }

  const int32_t width_px_, height_px_;
  double square_ = 0;
};

template <TraitBits kTraits, typename Tracer>
class LightPathIntegrator {
 public:
  using C = IntegratorConfig<kTraits, Tracer, DirectLight::kByBoth, PathKind::kLight>;

  // All three must outlive *this. Not thread-safe: one for each thread.
  LightPathIntegrator(const CompiledScene& scene, Tracer& tracer, RayCounts& counts)
      : scene_(scene), tracer_(tracer), counts_(counts) {
    SetFields(scene.guiding ? scene.guiding->fields() : nullptr);
  }

  // Traces the light path of the pixel and pass: a pure function of both and the scene. The pixel
  // only names the path, which may bring light to any. map: as for TraceLight, of the pass.
  void TracePath(int32_t x, int32_t y, uint64_t pass, const GatherMap* map, SplatSink* splats) {
    const Sampler sampler(scene_.settings.seed ^ kLightPathSeed, x, y, pass,
                          scene_.settings.one_sequence);
    PathState<C> path;
    Trace(sampler, map, &path, splats, [](const Context<C>&) {});
  }
  // Traces a path of a training: a pure function of the scene, the fields, the pass and the path's
  // number. Gives what it brought to the whole frame to the statistics.
  void TraceForTraining(const TrainingPass& pass, uint64_t number, const LearnedFields& fields,
                        EmissionStatistics* statistics) {
    SetFields(&fields);
    FrameSplats splats(scene_.settings.width_px, scene_.settings.height_px);
    EmissionOrigin origin;
    PathState<C> path;
    Trace(pass.SamplerOf(number), nullptr, &path, &splats,
          [&](const Context<C>& context) { origin = OriginOf(context, path); });
    if (splats.square() > 0) statistics->Add(number, {origin, splats.square()});
  }

 private:
  // fields: null where nothing has been learned.
  void SetFields(const LearnedFields* fields) {
    emission_ = EmissionBy<C>(scene_, fields);
    if constexpr (C::kKnowsLights) guiding_.fields = fields;
  }
  // *path: new. Calls begun(context) where the path has left its light.
  template <typename Begun>
  void Trace(const Sampler& sampler, const GatherMap* map, PathState<C>* path, SplatSink* splats,
             const Begun& begun) {
    const Context<C> context{scene_,  tracer_, sampler,  counts_,
                             nullptr, groups_, guiding_, emission_};
    if constexpr (C::Has(Trait::kMotion)) {
      path->ray.time = scene_.camera.ShutterFraction(
          map != nullptr ? map->sample.time : sampler.Get1(Slot(CameraSlot::kTime)));
    }
    if constexpr (C::kSpectral) {
      path->wavelengths = scene_.wavelengths.Sample(
          map != nullptr ? map->sample.wavelengths : sampler.Get1(Slot(CameraSlot::kWavelength)));
    }
    if (!StartAtLight(context, path)) return;
    begun(context);
    TraceLight(context, path, map, splats);
  }

  const CompiledScene& scene_;
  Tracer& tracer_;
  RayCounts& counts_;
  LightGroups<typename C::Color> groups_;
  // The camera's paths go by it, and weights depend on that.
  [[no_unique_address]] StateIf<C::kKnowsLights, Guiding<C>> guiding_;
  GuidedEmission emission_;
};

}  // namespace sheaf::render
