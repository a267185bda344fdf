// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MediumVertex: a vertex of a path in a medium, as a scatterer. SurfaceVertex has the same members.
#pragma once

#include <array>
#include <type_traits>

#include "common/film/film_tile.h"
#include "worker/render/integrator/equiangular_sampling.h"
#include "worker/render/integrator/first_hit.h"
#include "worker/render/integrator/guided_directions.h"
#include "worker/render/integrator/light_draw.h"
#include "worker/render/integrator/light_splits.h"
#include "worker/render/integrator/ray_sight.h"
#include "worker/render/integrator/russian_roulette.h"
#include "worker/render/integrator/subsurface_walk.h"
#include "worker/render/integrator/two_ends.h"

namespace sheaf::render {

template <typename C>
struct MediumVertex {
  using Color = typename C::Color;

  // A vertex at p, at distance `at` (in lengths of the path's ray). scatterer: the heterogeneous
  // medium that scatters the path, if any.
  MediumVertex(Vec3f p, double at, MediumScatterer scattered_by) : t(at), scatterer(scattered_by) {
    point.p = p;
  }

  SurfacePoint point;  // Without a normal: no side, and no surface to keep away from.
  double t;
  MediumScatterer scatterer;
  Vec3f d;  // Direction of the path, unit.
  PhaseMixture<Color> phase;
  [[no_unique_address]] GuidedDirectionsOf<C> guided;  // Known to camera paths.
  static constexpr Vec3f light_hint{};
  static constexpr bool kIsSurface = false;

  // Records the vertex and counts it. False where the path ends.
  bool Arrive(const Context<C>& c, PathState<C>* path, FilmSample* film);

  bool SamplesLights(const PathState<C>& path) const { return !path.media.properties.is_hidden; }
  LightDraw Draw(const Context<C>& c, const PathState<C>& path) const {
    return DrawLight(c, LastVertexIndex(path));
  }
  LightQuery Query() const { return guided.lights(); }
  BsdfValueOf<Color> Eval(Vec3f w) const {
    BsdfValueOf<Color> value = EvalScattering(w);
    if constexpr (C::kGuided) value.pdf = guided.Pdf(value.pdf, w);
    return value;
  }
  BsdfValueOf<Color> EvalScattering(Vec3f w) const {
    const typename PhaseMixture<Color>::Value value = phase.Eval(d, w);
    return {value.f, value.pdf};
  }
  float ScatteringShare() const { return guided.ScatteringShare(); }
  bool EnterSide(const Context<C>&, Vec3f, const PathState<C>&, MediumState<C>*) const {
    return true;
  }
  float LightSampleWeight(const Context<C>& c, const LightSampleOf<Color>& light, float pdf,
                          const PathState<C>& path) const {
    if constexpr (C::kPathKind == PathKind::kCameraBesideLight) {
      const double line_over_sample =
          light.is_infinite ? 0 : LineOverSample(c, path, light.light, point.p, guided.lights());
      return LightSampleWeightBesideLight(c, *this, light, pdf, path, line_over_sample);
    } else if constexpr (C::kLines) {
      const LineOf<C>& line = path.media.line;
      if (line.has_scattered) {
        return LightSampleWeightOnLine(c, line, light, point.p, guided.lights(), pdf);
      }
    }
    return light.is_delta ? 1.0f : MisWeight<C>(FindsBy::kLightSample, light.pdf, pdf);
  }
  LightPathKind LightKind(const PathState<C>& path) const { return path.history.KindFromMedium(); }
  template <typename History>
  void AddTo(History* history) const {
    history->AddMedium(false);
  }
  // Samples the next ray of the path. False where the path ends.
  bool Scatter(const Context<C>& c, PathState<C>* path) const;
  bool ScatterFromLight(const Context<C>& c, PathState<C>* path) const;
  // The vertex as a path sees it that arrives along -wo.
  MediumVertex SeenFrom(const Context<C>&, Vec3f wo) const {
    MediumVertex seen = *this;
    seen.d = -wo;
    return seen;
  }
  bool IsReversible(const Context<C>&, Vec3f, uint8_t) const { return true; }
  // Media scatter flux as they scatter radiance.
  float FluxFactor(Vec3f, const PathState<C>&) const { return 1; }
  float ShadingCosines(Vec3f) const { return 1; }

 private:
  void Record(const Context<C>& c, const PathState<C>& path, FilmSample* film) const;
  // A direction in which a camera path may continue. *density_scale and *roulette_scale: as for
  // surfaces.
  typename PhaseMixture<Color>::Sample SampleDirection(const std::array<float, 4>& u,
                                                       float* density_scale,
                                                       float* roulette_scale) const;
  PhaseMixture<Color> MakePhase(const Context<C>& c, const PathState<C>& path) const;
};

template <typename C>
void MediumVertex<C>::Record(const Context<C>& c, const PathState<C>& path,
                             FilmSample* film) const {
  const MediumForm form = path.media.properties.form;
  const Rgb* subsurface_texture = nullptr;
  if constexpr (std::is_same_v<Color, Rgb>)
    subsurface_texture = path.media.subsurface_texture.OrNull();
  MediumProperties<Rgb> properties =
      c.scene.media->template PropertiesOf<Rgb>(path.media.set, {}, form, subsurface_texture);
  if constexpr (C::kHeterogeneous) {
    if (scatterer) {
      const auto its = c.scene.media->template CoefficientsAt<Rgb>(
          *scatterer, ToDouble(point.p), TimeOfMedia<C::kTraits>(path.ray.time), {}, form);
      properties.sigma_t = its.sigma_t;
      properties.sigma_s = its.sigma_s;
    }
  }
  film->albedo = MakeColor<Rgb>([&](size_t i) {
    return properties.sigma_t[i] > 0 ? properties.sigma_s[i] / properties.sigma_t[i] : 0;
  });
  film->alpha = 1;
  film->normal = {};
  film->depth = Length(point.p - path.camera_o);
  if constexpr (C::kOutputs) {
    if (c.outputs != nullptr) RecordFirstEventInMedium(c.scene, path.ray, point.p, c.outputs);
  }
}

template <typename C>
PhaseMixture<typename C::Color> MediumVertex<C>::MakePhase(const Context<C>& c,
                                                           const PathState<C>& path) const {
  if constexpr (C::kHeterogeneous) {
    if (scatterer) {
      PhaseMixture<Color> its;
      its.Add(c.scene.media->PhaseAsymmetryOf(*scatterer, path.media.properties.form),
              Color::Gray(1), 1);
      return its;
    }
  }
  if constexpr (C::kLines && !C::kBothEnds) {
    const LineOf<C>& line = path.media.line;
    if (line.has_scattered) return PhaseOnLine(c, line, line.t, path);
  }
  // Paths from both ends must choose among overlapping media alike.
  return c.scene.media->template PhaseOf<Color>(
      path.media.set, path.media.properties, C::kBothEnds ? Color::Gray(1) : path.throughput,
      path.wavelengths, path.media.subsurface_texture.OrNull());
}

template <typename C>
bool MediumVertex<C>::Arrive(const Context<C>& c, PathState<C>* path, FilmSample* film) {
  path->null_crossings = 0;
  if (path->is_camera_path) {
    path->is_camera_path = false;
    Record(c, *path, film);
    StartOtherEnd(c, point.p, path);
  }
  LeavePrefix(path);
  if (!CountVertex(c, path->media.properties.is_subsurface, path)) return false;
  if constexpr (C::kSubsurface) {
    if (path->media.properties.is_subsurface) {
      PlaceSubsurfaceVertex(
          ToDouble(path->ray.o) + path->subsurface.offset + ToDouble(path->ray.d) * t, point.p,
          path);
    }
  }
  d = Normalize(path->ray.d);
  phase = MakePhase(c, *path);
  if constexpr (C::kKnowsLights) {
    // Walks beneath a surface are short, and see no light that others do not.
    if (!path->media.properties.is_subsurface) guided = GuidedDirectionsAt(c, {point.p});
  }
  CountScattering(c, *path, &path->media);
  return true;
}

template <typename C>
typename PhaseMixture<typename C::Color>::Sample MediumVertex<C>::SampleDirection(
    const std::array<float, 4>& u, [[maybe_unused]] float* density_scale,
    [[maybe_unused]] float* roulette_scale) const {
  float u_lobe = u[2];
  if constexpr (C::kGuided && !C::kFromLight) {
    typename PhaseMixture<Color>::Sample sample;
    const bool is_guided = guided.Selects(&u_lobe);
    if (is_guided) {
      sample.w = guided.Sample({u[0], u[1]});
    } else {
      sample = phase.SampleDirection(d, u_lobe, {u[0], u[1]});
      if (!guided.active()) return sample;
    }
    const BsdfValueOf<Color> value = EvalScattering(sample.w);
    sample.pdf = guided.Pdf(value.pdf, sample.w);
    sample.weight = sample.pdf > 0 ? value.f_cos * (1 / sample.pdf) : Color{};
    *density_scale = value.pdf > 0 ? sample.pdf / value.pdf : 0;
    if (value.pdf > 0) *roulette_scale *= *density_scale;
    return sample;
  }
  return phase.SampleDirection(d, u_lobe, {u[0], u[1]});
}

template <typename C>
bool MediumVertex<C>::Scatter(const Context<C>& c, PathState<C>* path) const {
  const std::array<float, 4> u = c.sampler.Get4(Slot(LastVertexIndex(*path), VertexSlot::kBsdf));
  float density_scale = 1;
  const typename PhaseMixture<Color>::Sample sample =
      SampleDirection(u, &density_scale, &path->roulette_scale);
  if constexpr (C::kGuided) NoteGuiding(guided, density_scale, path);
  path->throughput *= sample.weight;
  if (path->throughput.IsBlack()) return false;
  const uint8_t flags = path->media.properties.is_hidden ? uint8_t{kBsdfSpecular} : uint8_t{0};
  NoteScattering(c, *this, sample.w, sample.pdf, flags, 1, path);
  if constexpr (C::kChains) path->chain = {.is_scattered = true};
  path->specular = path->media.properties.is_hidden;
  path->history.AddMedium(path->media.properties.is_subsurface);
  path->pdf = sample.pdf;
  path->from = point.p;
  path->from_n = {};
  RememberLights(guided, path);
  if constexpr (C::kSplitsLights) path->splits = {};
  if constexpr (C::kProduct) path->sketch = {};
  const bool is_beneath = path->media.properties.is_subsurface;
  BeginRay(is_beneath ? RayKind::kDiffuse : RayKind::kVolume, path);
  path->ray.o = point.p;
  path->ray.d = sample.w;
  path->ray.source = {};
  path->ray.contact = path->ray.lead = 0;
  path->ray.own_offset = {};
  // Few paths leave a cloud at once: AddInfiniteLe looks for the place of those that do.
  if (!C::kHeterogeneous || !path->media.properties.is_heterogeneous) {
    path->sky_place = c.scene.lights->template PrepareEnvironment<C::kTraits>(sample.w);
  }
  // Remember the direction, and learn later what light came from there.
  if constexpr (C::kGuided) NoteDirection(c, *this, *path);
  return SurvivesRoulette(c, u[3], path);
}

template <typename C>
bool MediumVertex<C>::ScatterFromLight(const Context<C>& c, PathState<C>* path) const {
  const bool is_hidden = path->media.properties.is_hidden;
  const Vec3f arrived_along = d;
  const bool continues = Scatter(c, path);
  StepDensities step;
  if (!is_hidden) {
    step = {static_cast<double>(SeenFrom(c, path->ray.d).Eval(-arrived_along).pdf),
            static_cast<double>(path->pdf)};
  }
  NoteScatteringFromLight(step, is_hidden, &path->other_end);
  return continues;
}

}  // namespace sheaf::render
