// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FollowedPaths: random light paths are stored and followed again from the lens, vertex by vertex,
// with the ratios of densities that both ends carry, for tests that compare them with LogDensityOf.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <type_traits>
#include <variant>
#include <vector>

#include "tests/support/densities/density_scenes.h"
#include "tests/support/densities/log_density.h"
#include "tests/support/densities/specular_sample.h"
#include "tests/support/guided_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/guiding_training.h"
#include "worker/render/integrator/direct_lighting.h"

namespace sheaf::render {

template <TraitBits kTraits>
class FollowedPaths : public ::testing::Test {
 protected:
  using Stored = StoredPath<kTraits>;
  using FromLens = typename Stored::FromLens;
  using FromLight = typename Stored::FromLight;
  using Color = typename FromLens::Color;
  static constexpr bool kGuided = Has(kTraits, Trait::kGuiding);
  static constexpr uint64_t kSeed = 7;

  // A path as the light path that found it leaves it.
  struct Found {
    Stored path;
    std::vector<decltype(PathState<FromLight>::media)> media;  // In which each place was reached.
    uint64_t index = 0;                                        // The light path's.
    WavelengthsOf<Color> wavelengths;
    double camera_over_light = 0;
    float weight = 0;
    // Where the camera sees the path in the mirror, and light paths find it by merging.
    bool is_merged = false;
    PathState<FromLight> arrived;  // At the vertex that the camera sees there.
    double scattering_pdf = 0;     // There, of a path from the lens.
  };
  // The throughput of a path from the lens to the last place.
  struct Carried {
    double light_over_hit = 0, sample_over_hit = 0, light_over_sample = 0, line_over_sample = 0;
    double hit_weight = 0, sample_weight = 0, line_weight = 0;
    float merge_radius = 0;
  };

  void Load(const TestScene& test_scene, TechniqueSet techniques) {
    FrameSettings settings = SquareSettings(16, 1, 8);
    settings.techniques = techniques;
    if (FromLens::kSpectral) settings.color = ColorTransport::kSpectral;
    if (FromLens::kSplitsLights) settings.light_samples = 8;
    compiled_ = Compile(test_scene.scene, settings, kSmallTraining);
    ASSERT_TRUE(EnsureGuiding(*compiled_, {}).ok());
  }
  template <typename C>
  Context<C> ContextOf(const Sampler& sampler, LightGroups<Color>& groups) {
    Context<C> context{*compiled_, *compiled_->tracer, sampler, counts_, nullptr, groups, {}, {}};
    context.emission =
        EmissionBy<C>(*compiled_, compiled_->guiding ? compiled_->guiding->fields() : nullptr);
    if constexpr (kGuided) context.guiding.fields = compiled_->guiding->fields();
    return context;
  }

  // Adds the paths of the light path of that index.
  void AddPaths(uint64_t index, std::vector<Found>* found);
  // Adds the path that is connected to the lens at its last vertex.
  template <typename V>
  void Connect(const Context<FromLight>& c, const V& at, const PathState<FromLight>& path,
               const Found& so_far, std::vector<Found>* found);
  // Adds the path that the camera sees in the mirror of MirrorScenes, to its last vertex.
  template <typename V>
  void ConnectInMirror(const Context<FromLight>& c, const V& at, const PathState<FromLight>& path,
                       const Found& so_far, std::vector<Found>* found);
  // Sets the density and the weight of light paths that are merged at the radius.
  void Merge(float radius, Found* found);
  // Follows the path from the lens. None where rounding or a cut-off leads elsewhere.
  std::optional<Carried> Follow(Found* found);
  bool MeetPlace(const Context<FromLens>& c, Found* found, size_t i, PathState<FromLens>* path);
  template <typename V>
  bool Pass(const Context<FromLens>& c, const V& at, Vec3f wi, typename Stored::Place* place,
            PathState<FromLens>* path);
  template <typename V>
  std::optional<Carried> CarriedTo(const Context<FromLens>& c, const V& at,
                                   const PathState<FromLens>& before, Found* found,
                                   PathState<FromLens>* path);
  // The same of the emission of media.
  template <typename V>
  std::optional<Carried> CarriedToMedium(const Context<FromLens>& c, const V& at, Found* found,
                                         PathState<FromLens>* path);
  // The same of the segment's line, which samples the light as well.
  template <typename V>
  void CarriedByLine(const Context<FromLens>& c, const V& at, const LightSampleOf<Color>& light,
                     const PathState<FromLens>& before, const PathState<FromLens>& path,
                     Carried* carried);
  bool ReachInMedium(const Context<FromLens>& c, const MediumVertex<FromLight>& met, Vec3f p,
                     typename Stored::Place* place, PathState<FromLens>* path);

  CompiledScenePtr compiled_;
  RayCounts counts_;
};

// --- From the light ------------------------------------------------------------------------------

template <TraitBits kTraits>
template <typename V>
void FollowedPaths<kTraits>::Connect(const Context<FromLight>& c, const V& at,
                                     const PathState<FromLight>& path, const Found& so_far,
                                     std::vector<Found>* found) {
  const auto seen = compiled_->camera.SampleWi(at.point.p, {0.3f, 0.7f}, 0);
  if (!seen) return;
  const auto value = at.SeenFrom(c, seen->wi).Eval(-path.ray.d);
  if (value.f_cos.IsBlack() || !(value.pdf > 0)) return;
  double line = 0;
  if (TransmittanceToLens(c, at, *seen, {}, path, &line).IsBlack()) return;
  Found& added = found->emplace_back(so_far);
  added.path.camera_ray.o = seen->p_lens;
  added.path.camera_ray.d = -seen->wi;
  added.path.light = path.other_end;
  added.wavelengths = path.wavelengths;
  const auto flux = static_cast<double>(at.FluxFactor(seen->wi, path));
  added.camera_over_light =
      CameraPathsAtLens(c, static_cast<double>(value.pdf), flux, seen->ray_density, path, line);
  added.weight = ConnectionWeight(c, added.camera_over_light);
}

template <TraitBits kTraits>
template <typename V>
void FollowedPaths<kTraits>::ConnectInMirror(const Context<FromLight>& c, const V& at,
                                             const PathState<FromLight>& path, const Found& so_far,
                                             std::vector<Found>* found) {
  if constexpr (V::kIsSurface) {
    const auto x = static_cast<float>(kMirrorX - compiled_->geometry.render_origin_world.x);
    const Vec3f p = at.point.p, image{2 * x - p.x, p.y, p.z};
    const auto seen = compiled_->camera.SampleWi(image, {0.3f, 0.7f}, 0);
    if (!seen) return;
    const Vec3f lens = seen->p_lens,
                in_mirror = lens + (image - lens) * ((x - lens.x) / (image.x - lens.x));
    const Vec3f w = Normalize(in_mirror - p);
    const auto value = at.SeenFrom(c, w).Eval(-path.ray.d);
    if (value.f_cos.IsBlack() || !(value.pdf > 0)) return;
    Vertex<FromLight> vertex;
    PathState<FromLight> onward = path;
    Leave(at.point, w, &onward.ray);
    onward.ray.d = w;
    NextVertex(c, &onward, &vertex);
    const auto* mirror = std::get_if<SurfaceVertex<FromLight>>(&vertex);
    if (mirror == nullptr || !mirror->bsdf.specular ||
        Length(mirror->point.p - in_mirror) > 1e-3f) {
      return;
    }
    Found& added = found->emplace_back(so_far);
    added.path.places.insert(added.path.places.begin(), {{}, vertex, /*is_specular=*/true});
    added.media.insert(added.media.begin(), onward.media);
    added.path.camera_ray.o = lens;
    added.path.camera_ray.d = Normalize(in_mirror - lens);
    added.path.light = path.other_end;
    added.wavelengths = path.wavelengths;
    added.is_merged = true;
    added.arrived = path;
    added.scattering_pdf = static_cast<double>(value.pdf);
  }
}

template <TraitBits kTraits>
void FollowedPaths<kTraits>::Merge(float radius, Found* found) {
  const Sampler sampler(kSeed, 0, 0, found->index);
  LightGroups<Color> groups;
  const Context<FromLight> c = ContextOf<FromLight>(sampler, groups);
  const auto& at = std::get<SurfaceVertex<FromLight>>(found->path.places[1].from_light);
  const double cosine =
      std::fabs(static_cast<double>(Dot(Normalize(found->arrived.ray.d), at.point.ng)));
  found->path.merge_radius = static_cast<double>(radius);
  found->camera_over_light = CameraPathsAtMerge(c, found->scattering_pdf, radius, cosine,
                                                /*camera_vertices=*/2, found->arrived);
  found->weight = ConnectionWeight(c, found->camera_over_light);
}

template <TraitBits kTraits>
void FollowedPaths<kTraits>::AddPaths(uint64_t index, std::vector<Found>* found) {
  const Sampler sampler(kSeed, 0, 0, index);
  LightGroups<Color> groups;
  const Context<FromLight> c = ContextOf<FromLight>(sampler, groups);
  PathState<FromLight> path;
  if constexpr (FromLight::kSpectral) path.wavelengths = compiled_->wavelengths.Sample(0.4f);
  if (!StartAtLight(c, &path)) return;
  Found so_far;
  so_far.index = index;
  so_far.path.towards_light = -Normalize(path.ray.d);
  Vertex<FromLight> vertex;
  const auto pass = [&](auto& at) {
    so_far.media.insert(so_far.media.begin(), path.media);
    if constexpr (FromLight::kMedia) {
      if (so_far.media.size() == 1) so_far.path.last_media = path.media;
    }
    bool is_rough = false;
    if (!ArriveFromLight(c, at, &path, &is_rough)) return false;
    auto& places = so_far.path.places;
    places.insert(places.begin(), {{}, vertex});
    if (is_rough && compiled_->gather_step > 0) ConnectInMirror(c, at, path, so_far, found);
    if (is_rough && compiled_->gather_step == 0) Connect(c, at, path, so_far, found);
    if (!at.ScatterFromLight(c, &path)) return false;
    places.front().is_specular = path.specular;
    return true;
  };
  for (;;) {
    NextVertex(c, &path, &vertex);
    bool continues = false;
    if (auto* surface = std::get_if<SurfaceVertex<FromLight>>(&vertex)) {
      continues = pass(*surface);
    } else if (auto* passed = std::get_if<NullInterface>(&vertex)) {
      MeetLine(c, passed->point.p, &path);
      continues = CrossNullInterface(c, passed->point, &path);
    } else if constexpr (FromLight::kMedia) {
      if (auto* medium = std::get_if<MediumVertex<FromLight>>(&vertex)) continues = pass(*medium);
    }
    if (!continues) return;
  }
}

// --- From the lens -------------------------------------------------------------------------------

// At p, where a medium scatters the path, behind null interfaces.
template <TraitBits kTraits>
bool FollowedPaths<kTraits>::ReachInMedium(const Context<FromLens>& c,
                                           const MediumVertex<FromLight>& met, Vec3f p,
                                           typename Stored::Place* place,
                                           PathState<FromLens>* path) {
  double distance = 0;
  for (;;) {
    distance = Length(ToDouble(p) - ToDouble(path->ray.o));
    RawHit hit;
    if (!c.tracer.Intersect(path->ray, &hit) || static_cast<double>(hit.t) >= distance) break;
    ResolveSurface(c, hit, path, &place->from_lens);
    const auto* passed = std::get_if<NullInterface>(&place->from_lens);
    if (passed == nullptr) return false;
    const SurfacePoint point = passed->point;
    Leave(point, path->ray.d, &path->ray);
  }
  place->segment_start = ToDouble(path->ray.o);
  if constexpr (FromLens::kLines) {
    RecordLineScattering(c, MakeLine(c, *path, distance), distance, met.scatterer, path);
  }
  place->from_lens.template emplace<MediumVertex<FromLens>>(p, distance, met.scatterer);
  return true;
}

template <TraitBits kTraits>
bool FollowedPaths<kTraits>::MeetPlace(const Context<FromLens>& c, Found* found, size_t i,
                                       PathState<FromLens>* path) {
  Vertex<FromLens>* vertex = &found->path.places[i].from_lens;
  const auto& stored = found->path.places[i].from_light;
  const Vec3f p = WithScatterer<FromLight>(stored, [](const auto& at) { return at.point.p; });
  path->ray.d = Normalize(p - path->ray.o);
  if constexpr (FromLens::kMedia) {
    path->media.set = found->media[i].set;
    path->media.properties = found->media[i].properties;
    path->media.line.has_scattered = false;
    if (const auto* medium = std::get_if<MediumVertex<FromLight>>(&stored)) {
      return ReachInMedium(c, *medium, p, &found->path.places[i], path);
    }
  }
  for (;;) {
    RawHit hit;
    if (!c.tracer.Intersect(path->ray, &hit)) return false;
    ResolveSurface(c, hit, path, vertex);
    const auto* passed = std::get_if<NullInterface>(vertex);
    if (passed == nullptr) break;
    const SurfacePoint point = passed->point;
    Leave(point, path->ray.d, &path->ray);
  }
  auto* surface = std::get_if<SurfaceVertex<FromLens>>(vertex);
  if constexpr (FromLens::kPerturbedNormals) {
    // Tilted normals scatter by random numbers that belong to the path: those of the light path.
    const auto* met = std::get_if<SurfaceVertex<FromLight>>(&stored);
    if (surface != nullptr && met != nullptr) {
      surface->index = met->index;
      *surface = surface->SeenFrom(c, -path->ray.d);
    }
  }
  return surface != nullptr && Length(surface->point.p - p) <= 1e-4f * (1 + Length(p));
}

template <TraitBits kTraits>
template <typename V>
bool FollowedPaths<kTraits>::Pass(const Context<FromLens>& c, const V& at, Vec3f wi,
                                  typename Stored::Place* place, PathState<FromLens>* path) {
  float pdf = at.Eval(wi).pdf, eta_scale = 1;
  uint8_t flags = 0;
  if (place->is_specular) {
    if constexpr (std::is_same_v<V, SurfaceVertex<FromLens>>) {
      const auto sample = SpecularSample<kTraits, FromLens>(at, wi);
      if (!sample) return false;
      flags = sample->flags;
      eta_scale = sample->eta_scale;
      place->eta_scale = static_cast<double>(eta_scale);
    }
  } else if (!(pdf > 0)) {
    return false;
  }
  NoteScattering(c, at, wi, pdf, flags, eta_scale, path);
  path->specular = place->is_specular;
  path->pdf = pdf;
  path->from = at.point.p;
  path->from_n = at.light_hint;
  if constexpr (std::is_same_v<V, SurfaceVertex<FromLens>>) {
    Leave(at.point, wi, &path->ray);
  } else {
    path->ray.o = at.point.p;
    path->ray.source = {};
  }
  path->ray.d = wi;
  return true;
}

template <TraitBits kTraits>
template <typename V>
void FollowedPaths<kTraits>::CarriedByLine(const Context<FromLens>& c, const V& at,
                                           const LightSampleOf<Color>& light,
                                           const PathState<FromLens>& before,
                                           const PathState<FromLens>& path, Carried* carried) {
  if constexpr (!V::kIsSurface) {
    const auto& line = path.media.line;
    carried->line_over_sample =
        light.is_infinite ? 0
                          : LineOverSample(c, path, light.light, at.point.p, at.guided.lights());
    if (!(carried->line_over_sample > 0)) return;
    const double sampled = static_cast<double>(light.pdf) * line.density;
    const double scattering =
        light.is_delta ? 0 : static_cast<double>(at.Eval(light.wi).pdf) * line.density;
    carried->line_weight =
        LineSampleWeight(c, TechniquePdfs{sampled, scattering, sampled * carried->line_over_sample},
                         light, at.point.p, at.EvalScattering(light.wi).pdf, before);
  }
}

template <TraitBits kTraits>
template <typename V>
std::optional<typename FollowedPaths<kTraits>::Carried> FollowedPaths<kTraits>::CarriedToMedium(
    const Context<FromLens>& c, const V& at, Found* found, PathState<FromLens>* path) {
  typename Stored::Place& place = found->path.places.back();
  const Vec3f p = at.point.p, w = found->path.towards_light;
  const double emitted = MediaDensityAt(c, p, w),
               sampled = place.is_specular ? 0 : MediaPdf(c, p, w);
  Carried carried;
  if (sampled > 0) {
    carried.sample_weight =
        static_cast<double>(MediaSampleWeightBesideLight(c, at, w, sampled, at.Eval(w).pdf, *path));
    carried.light_over_sample = LightPathsOverSample(c, at, w, emitted, sampled, *path);
  }
  if (!Pass(c, at, w, &place, path)) return std::nullopt;
  carried.light_over_hit = path->other_end.light_paths.ratio() * emitted;
  carried.sample_over_hit = place.is_specular ? 0 : sampled / static_cast<double>(path->pdf);
  carried.hit_weight = static_cast<double>(HitWeight(c, sampled, emitted, *path));
  return carried;
}

template <TraitBits kTraits>
template <typename V>
std::optional<typename FollowedPaths<kTraits>::Carried> FollowedPaths<kTraits>::CarriedTo(
    const Context<FromLens>& c, const V& at, const PathState<FromLens>& before, Found* found,
    PathState<FromLens>* path) {
  const LightEnd& end = found->path.light;
  if (end.is_medium) return CarriedToMedium(c, at, found, path);
  typename Stored::Place& place = found->path.places.back();
  const Vec3f p = at.point.p;
  const Vec3f wi = end.is_infinite ? found->path.towards_light : Normalize(end.p - p);
  const double emitted = end.is_infinite ? c.emission.InfiniteDensityAt(p, -wi)
                                         : c.emission.DensityAt(end.light, p, end.p, end.n, -wi);
  Carried carried;
  carried.merge_radius = path->other_end.merge_radius;
  LightSampleOf<Color> light;
  light.wi = wi;
  light.p_light = end.p;
  light.n_light = end.n;
  light.light = end.light;
  light.is_infinite = end.is_infinite;
  light.is_delta = !end.can_be_hit;
  if (!place.is_specular) {
    const auto& lights = *compiled_->lights;
    const LightQuery query = at.Query();
    light.pdf =
        light.is_delta
            ? lights.choice().Probability(end.light, p, at.light_hint, QueryFor<kTraits>(query))
        : end.is_infinite
            ? lights.template PdfEnvironment<kTraits>(p, at.light_hint, wi, query)
            : lights.template PdfEmitter<kTraits>(end.light, p, at.light_hint, wi, end.p, query);
    carried.sample_weight =
        static_cast<double>(at.LightSampleWeight(c, light, at.Eval(wi).pdf, *path));
    carried.light_over_sample =
        LightPathsOverSample(c, at, wi, emitted, static_cast<double>(light.pdf), *path);
    if constexpr (FromLens::kLines) CarriedByLine(c, at, light, before, *path, &carried);
  }
  if (end.can_be_hit) {
    if (!Pass(c, at, wi, &place, path)) return std::nullopt;
    const auto sampled = static_cast<double>(light.pdf);
    carried.light_over_hit = path->other_end.light_paths.ratio() * emitted;
    carried.sample_over_hit = place.is_specular ? 0 : sampled / static_cast<double>(path->pdf);
    carried.hit_weight =
        static_cast<double>(HitWeight(c, sampled, emitted, *path, carried.line_over_sample));
  }
  return carried;
}

template <TraitBits kTraits>
std::optional<typename FollowedPaths<kTraits>::Carried> FollowedPaths<kTraits>::Follow(
    Found* found) {
  const Sampler sampler(kSeed, 0, 0, found->index);
  LightGroups<Color> groups;
  const Context<FromLens> c = ContextOf<FromLens>(sampler, groups);
  PathState<FromLens> path;
  path.wavelengths = found->wavelengths;
  path.ray.o = path.camera_o = found->path.camera_ray.o;
  FilmSample unused;
  auto& places = found->path.places;
  for (size_t i = 0; i < places.size(); ++i) {
    Vertex<FromLens>& vertex = places[i].from_lens;
    if (!MeetPlace(c, found, i, &path)) return std::nullopt;
    const PathState<FromLens> before = path;
    const auto arrive = [&](auto& at) { return at.Arrive(c, &path, &unused); };
    bool arrives = false;
    if (auto* surface = std::get_if<SurfaceVertex<FromLens>>(&vertex)) {
      arrives = arrive(*surface);
    } else if constexpr (FromLens::kMedia) {
      arrives = arrive(std::get<MediumVertex<FromLens>>(vertex));
    }
    if (!arrives) return std::nullopt;
    if (i + 1 == places.size()) {
      return WithScatterer<FromLens>(
          vertex, [&](const auto& at) { return CarriedTo(c, at, before, found, &path); });
    }
    const Vec3f next = WithScatterer<FromLight>(places[i + 1].from_light,
                                                [](const auto& at) { return at.point.p; });
    const bool passes = WithScatterer<FromLens>(vertex, [&](const auto& at) {
      return Pass(c, at, Normalize(next - at.point.p), &places[i], &path);
    });
    if (!passes) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace sheaf::render
