// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SurfaceVertex: a vertex of a path on a surface, as a scatterer. MediumVertex has the same
// members, so that direct lighting and the integrator's loop are written once for both.
#pragma once

#include <array>
#include <optional>

#include "common/film/film_tile.h"
#include "worker/render/bsdf/perturbed_normal.h"
#include "worker/render/gather/gather_point.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/integrator/context.h"
#include "worker/render/integrator/first_hit.h"
#include "worker/render/integrator/guided_directions.h"
#include "worker/render/integrator/light_draw.h"
#include "worker/render/integrator/light_sketches.h"
#include "worker/render/integrator/light_splits.h"
#include "worker/render/integrator/medium_boundaries.h"
#include "worker/render/integrator/mis_weights.h"
#include "worker/render/integrator/ray_sight.h"
#include "worker/render/integrator/russian_roulette.h"
#include "worker/render/integrator/subsurface_walk.h"
#include "worker/render/integrator/two_ends.h"

namespace sheaf::render {

template <typename C>
struct SurfaceVertex {
  using Color = typename C::Color;
  using OptionalNormal = StateIf<C::kPerturbedNormals, PerturbedNormal>;
  using Plane = StateIf<C::kNormalMaps, std::optional<TangentPlane>>;

  // The hit of the path's ray; `bsdf` and what follows it are set later.
  SurfaceVertex(const Context<C>& c, const RawHit& hit, const PathState<C>& path)
      // Prefetches the light, before the surface is known.
      : draw(C::kFromLight ? LightDraw{} : DrawLight(c, NextVertexIndex(path))),
        point(MakeSurfacePoint<C::kTraits>(c.scene.geometry, path.ray, hit, &plane)) {
    if constexpr (C::kPerturbedNormals) index = NextVertexIndex(path);
    if constexpr (C::kKeepsNormal) interpolated_shading = point.shading;
  }

  // The vertex at p of a camera path that was stored, for Eval and the normals. Requires:
  // kBothEnds.
  SurfaceVertex(const Context<C>& c, Vec3f p, const GatherPointOf<Color>& stored)
      : bsdf(stored.bsdf), wo_local(stored.wo_local) {
    point.p = p;
    point.ng = stored.ng;
    point.shading = {stored.t, Cross(stored.n, stored.t), stored.n};
    if constexpr (C::kPerturbedNormals) perturbed_normal = stored.perturbed_normal;
    light_hint = stored.ng * static_cast<float>(stored.light_side);
    if constexpr (C::kKnowsLights) {
      guided = GuidedDirectionsAt(c, {p, light_hint}, /*may_guide=*/true);
    }
  }
  // Stores the parts of the vertex that a gather point keeps.
  void Store(GatherPointOf<Color>* stored) const {
    stored->bsdf = bsdf;
    stored->ng = point.ng;
    stored->n = point.shading.n;
    stored->t = point.shading.t;
    stored->wo_local = wo_local;
    if constexpr (C::kPerturbedNormals) stored->perturbed_normal = perturbed_normal;
    const float side = Dot(light_hint, point.ng);
    stored->light_side = static_cast<int8_t>(side > 0 ? 1 : side < 0 ? -1 : 0);
  }

  LightDraw draw;
  Plane plane;
  SurfacePoint point;
  NullInterfaceChoice choice{};
  bool in_subsurface = false;  // Met from inside a subsurface medium.
  BsdfOf<Color> bsdf;
  [[no_unique_address]] OptionalNormal perturbed_normal;
  [[no_unique_address]] StateIf<C::kPerturbedNormals, uint32_t> index;  // For sample dimensions.
  [[no_unique_address]] StateIf<C::kKeepsNormal, Frame> interpolated_shading;  // Before Prepare.
  [[no_unique_address]] GuidedDirectionsOf<C> guided;  // Known to camera paths.
  [[no_unique_address]] StateIf<C::kSplitsLights, LightSplitState> splits;
  [[no_unique_address]] StateIf<C::kProduct, LobeSketch> sketch;
  Vec3f wo_local;
  Vec3f light_hint{};  // Lights behind this normal do not contribute; zero if all may.
  static constexpr bool kIsSurface = true;

  // Sets the shading frame, for a path that arrives along -wo. Call once, after the BSDF is known.
  void Prepare(const Context<C>& c, Vec3f wo);
  // The vertex as a path sees it that arrives along -wo, for Eval. Requires: kSeenFromElsewhere.
  SurfaceVertex SeenFrom(const Context<C>& c, Vec3f wo) const;
  // Whether a specular sample, which led to wi, leads back from there. Requires: kBothEnds.
  bool IsReversible(const Context<C>& c, Vec3f wi, uint8_t flags) const {
    return (flags & kBsdfRotated) == 0 && SeenFrom(c, wi).point.shading.n == point.shading.n;
  }
  // Records the vertex and counts it. False where the path ends.
  bool Arrive(const Context<C>& c, PathState<C>* path, FilmSample* film);

  bool SamplesLights(const PathState<C>&) const { return !bsdf.specular; }
  const LightDraw& Draw(const Context<C>&, const PathState<C>&) const { return draw; }
  // By which lights are sampled here.
  LightQuery Query() const {
    LightQuery query = guided.lights();
    if constexpr (C::kSplitsLights) query.samples_max = splits.samples_max;
    if constexpr (C::kProduct) query.sketch = sketch.OrNull();
    return query;
  }
  // f * |cos|, and the pdf with which camera paths continue towards w, per solid angle.
  BsdfValueOf<Color> Eval(Vec3f w) const {
    BsdfValueOf<Color> value = EvalScattering(w);
    if constexpr (C::kGuided) value.pdf = guided.Pdf(value.pdf, w);
    return value;
  }
  // The same for paths from lights, which no field guides.
  BsdfValueOf<Color> EvalScattering(Vec3f w) const;
  // The probability with which a camera path samples the BSDF.
  float ScatteringShare() const { return guided.ScatteringShare(); }
  // Changes *media to those on the side of w. False where no light arrives from there.
  bool EnterSide(const Context<C>& c, Vec3f w, const PathState<C>& path,
                 MediumState<C>* media) const {
    return render::EnterSide(c, point, w, IsHair<C::kTraits>(bsdf), path, media);
  }
  // The weight of a light sample, where scattering towards the light has density pdf.
  float LightSampleWeight(const Context<C>& c, const LightSampleOf<Color>& light, float pdf,
                          const PathState<C>& path) const {
    if constexpr (C::kPathKind == PathKind::kCameraBesideLight) {
      return LightSampleWeightBesideLight(c, *this, light, pdf, path);
    }
    return light.is_delta ? 1.0f : MisWeight<C>(FindsBy::kLightSample, light.pdf, pdf);
  }
  LightPathKind LightKind(const PathState<C>& path) const { return path.history.KindFromSurface(); }
  // Records that it scatters light from a rough lobe.
  template <typename History>
  void AddTo(History* history) const {
    history->AddSurface(false);
  }
  // Samples the next ray of the path. False where the path ends.
  bool Scatter(const Context<C>& c, PathState<C>* path) const;
  // The same for a path from a light.
  bool ScatterFromLight(const Context<C>& c, PathState<C>* path) const;
  // The factor by which a path from a light is multiplied beside f * |cos| where it continues along
  // w: it carries flux through the true surface. Source: Veach 1997, sec. 5.3.
  float FluxFactor(Vec3f w, const PathState<C>& path) const {
    return std::fabs(Dot(w, point.ng) / Dot(path.ray.d, point.ng));
  }
  // The same ratio for the shading normal.
  float ShadingCosines(Vec3f w) const {
    return IsHair<C::kTraits>(bsdf) ? 1 : std::fabs(point.shading.ToLocal(w).z / wo_local.z);
  }

 private:
  // Whether vertex normals are ignored. They may hold light in a glass body forever, by total
  // reflections that its faces do not have, so a path through many vertices meets the faces.
  bool FollowsFaces() const;
  // Tilts the shading frame by the material's map.
  OptionalNormal ApplyMap(const Context<C>& c, const TangentPlane& tangents, Vec3f wo);
  // Keeps the light that vertex normals tilt below the surface.
  OptionalNormal TiltByVertices(const Context<C>& c, Vec3f wo);
  OptionalNormal TiltTo(const Context<C>& c, PerturbedNormal::Source source);
  // A direction in which a path from a light may continue, in the shading frame.
  std::optional<BsdfSampleOf<Color>> SampleScattering(const std::array<float, 4>& u) const;
  // The same for a camera path. *density_scale: the density over that of scattering, 0 where that
  // is 0. *roulette_scale: multiplied by its PathState::roulette_scale.
  std::optional<BsdfSampleOf<Color>> SampleDirection(const std::array<float, 4>& u,
                                                     float* density_scale,
                                                     float* roulette_scale) const;
  // Continues the path along wi. False where it ends.
  bool Continue(const Context<C>& c, Vec3f wi, const BsdfSampleOf<Color>& sample, float u_roulette,
                PathState<C>* path) const;
  // Shading and geometric normal must agree on the side of a direction, given its cosines with
  // them, or light would leak through the surface. Tilted normals handle that themselves, and light
  // passes through hair.
  bool AgreesOnSide(float cos_shading, float cos_geometric) const {
    if constexpr (C::kPerturbedNormals) {
      if (perturbed_normal.active()) return true;
    }
    return IsHair<C::kTraits>(bsdf) || cos_shading * cos_geometric > 0;
  }
  Rgb Albedo(const Context<C>& c) const;
};

template <typename C>
bool SurfaceVertex<C>::FollowsFaces() const {
  constexpr uint32_t kSmoothVerticesMax = 16;
  return index >= kSmoothVerticesMax && !in_subsurface && Transmits<C::kTraits>(bsdf);
}

template <typename C>
typename SurfaceVertex<C>::OptionalNormal SurfaceVertex<C>::TiltTo(const Context<C>& c,
                                                                   PerturbedNormal::Source source) {
  if (point.shading.n == point.ng) return {};
  const std::array<float, 4> u = c.sampler.Get4(Slot(index, VertexSlot::kSurface));
  return {source, point.shading.ToLocal(point.ng), {u[2], u[3]}};
}

template <typename C>
typename SurfaceVertex<C>::OptionalNormal SurfaceVertex<C>::ApplyMap(const Context<C>& c,
                                                                     const TangentPlane& tangents,
                                                                     Vec3f wo) {
  TangentPlane seen = tangents;
  seen.n = ToDouble(point.shading.n);
  const Vec3f mapped = c.scene.materials->ShadingNormal(point.surface->material,
                                                        TexturePointOf(c, point), choice.mix, seen);
  const Vec3f n = BendNormal(LiftNormal(mapped, point.ng), point.ng, wo);
  point.shading = internal::ShadingFrame(n, seen);
  if constexpr (C::Has(Trait::kPrincipled))
    c.scene.materials->TiltCoat(point.surface->material, TexturePointOf(c, point), choice.mix, seen,
                                {point.shading, point.ng, wo}, &bsdf);
  return TiltTo(c, PerturbedNormal::Source::kMap);
}

template <typename C>
typename SurfaceVertex<C>::OptionalNormal SurfaceVertex<C>::TiltByVertices(const Context<C>& c,
                                                                           Vec3f wo) {
  const Frame given = point.shading;
  if (Dot(given.n, point.ng) >= kTiltCosineMax) return {};
  if (FollowsFaces()) {
    point.shading = Frame::FromNormal(point.ng);
    return {};
  }
  // Only reflections need to be bent; diffuse light has no mirror direction.
  const bool is_diffuse =
      bsdf.kind == BsdfKind::kDiffuse || bsdf.kind == BsdfKind::kDiffuseTransmission;
  if (is_diffuse && Dot(wo, given.n) * Dot(wo, point.ng) <= 0) return {};
  const Vec3f n = is_diffuse ? given.n : BendNormal(given.n, point.ng, wo);
  if (n != given.n) {
    const TangentPlane tangents{ToDouble(n), ToDouble(given.t), ToDouble(given.b), true};
    point.shading = internal::ShadingFrame(n, tangents);
  }
  return TiltTo(c, PerturbedNormal::Source::kVertices);
}

template <typename C>
void SurfaceVertex<C>::Prepare([[maybe_unused]] const Context<C>& c, Vec3f wo) {
  if (IsHair<C::kTraits>(bsdf)) return;
  if constexpr (C::kPerturbedNormals) {
    bool is_mapped = false;
    if constexpr (C::kNormalMaps) is_mapped = plane.has_value();
    if (!is_mapped) {
      perturbed_normal = TiltByVertices(c, wo);
      if (perturbed_normal.active()) return;
    }
  }
  // A shading normal seen from below its own horizon is meaningless: the geometric one replaces it.
  if (Dot(wo, point.shading.n) * Dot(wo, point.ng) <= 0) {
    point.shading = Frame::FromNormal(point.ng);
  }
  if constexpr (C::kNormalMaps) {
    if (plane) perturbed_normal = ApplyMap(c, *plane, wo);
  }
}

template <typename C>
SurfaceVertex<C> SurfaceVertex<C>::SeenFrom(const Context<C>& c, Vec3f wo) const {
  SurfaceVertex seen = *this;
  seen.point.shading = interpolated_shading;
  seen.perturbed_normal = {};
  seen.Prepare(c, wo);
  seen.wo_local = seen.point.shading.ToLocal(wo);
  return seen;
}

template <typename C>
Rgb SurfaceVertex<C>::Albedo(const Context<C>& c) const {
  if constexpr (C::kSpectral) {
    return c.scene.materials
        ->template Evaluate<C::kRgbTraits>(point.surface->material, TexturePointOf(c, point),
                                           choice.mix)
        .albedo;
  } else {
    return bsdf.albedo;
  }
}

template <typename C>
bool SurfaceVertex<C>::Arrive(const Context<C>& c, PathState<C>* path, FilmSample* film) {
  path->null_crossings = 0;
  if (path->is_camera_path) {
    path->is_camera_path = false;
    film->albedo = Albedo(c);
    film->alpha = 1;
    film->normal = point.shading.n;
    film->depth = Length(point.p - path->camera_o);
    StartOtherEnd(c, point.p, path);
    if constexpr (C::kOutputs) {
      if (c.outputs != nullptr) RecordFirstHit(c.scene, path->ray, point, c.outputs);
    }
  }
  if (!CountVertex(c, in_subsurface, path)) return false;
  if constexpr (C::kSpectral) {
    if (bsdf.disperses) TerminateSecondaryWavelengths(path);
  }
  const Vec3f wo = -path->ray.d;
  wo_local = point.shading.ToLocal(wo);
  if (!Transmits<C::kTraits>(bsdf)) light_hint = Dot(wo, point.ng) < 0 ? -point.ng : point.ng;
  if constexpr (C::kKnowsLights) {
    guided = GuidedDirectionsAt(c, {point.p, light_hint}, /*may_guide=*/!bsdf.specular);
  }
  if constexpr (C::kSplitsLights) splits = LightSplitsAt(c, *path);
  if constexpr (C::kProduct) sketch = SketchAt(c, bsdf, wo_local, point.shading);
  FollowPrefix(c, *this, path);
  return true;
}

template <typename C>
inline BsdfValueOf<typename C::Color> SurfaceVertex<C>::EvalScattering(Vec3f w) const {
  const Vec3f wi_local = point.shading.ToLocal(w);
  if (!AgreesOnSide(wi_local.z, Dot(w, point.ng))) return {};
  if constexpr (C::kPerturbedNormals) {
    if (perturbed_normal.active())
      return perturbed_normal.template Eval<C::kTraits>(bsdf, wo_local, wi_local);
  }
  return EvalBsdf<C::kTraits>(bsdf, wo_local, wi_local);
}

template <typename C>
inline std::optional<BsdfSampleOf<typename C::Color>> SurfaceVertex<C>::SampleScattering(
    const std::array<float, 4>& u) const {
  if constexpr (C::kPerturbedNormals) {
    if (perturbed_normal.active()) {
      return perturbed_normal.template Sample<C::kTraits>(bsdf, wo_local, u[2], {u[0], u[1]});
    }
  }
  return SampleBsdf<C::kTraits>(bsdf, wo_local, u[2], {u[0], u[1]});
}

template <typename C>
inline std::optional<BsdfSampleOf<typename C::Color>> SurfaceVertex<C>::SampleDirection(
    const std::array<float, 4>& u, [[maybe_unused]] float* density_scale,
    float* roulette_scale) const {
  if constexpr (C::kGuided) {
    std::array<float, 4> stretched = u;
    if (guided.Selects(&stretched[2])) {
      BsdfSampleOf<Color> sample;
      sample.wi = point.shading.ToLocal(guided.Sample({u[0], u[1]}));
      const Vec3f w = point.shading.ToWorld(sample.wi);
      const BsdfValueOf<Color> value = EvalScattering(w);
      if (value.f_cos.IsBlack()) return std::nullopt;
      sample.pdf = guided.Pdf(value.pdf, w);
      sample.weight = value.f_cos * (1 / sample.pdf);
      *density_scale = value.pdf > 0 ? sample.pdf / value.pdf : 0;
      if (value.pdf > 0) *roulette_scale *= *density_scale;
      return sample;
    }
    std::optional<BsdfSampleOf<Color>> sample = SampleScattering(stretched);
    if (sample && guided.active()) {
      const bool is_specular = (sample->flags & kBsdfSpecular) != 0;
      const float scale =
          is_specular ? ScatteringShare()
                      : guided.Pdf(sample->pdf, point.shading.ToWorld(sample->wi)) / sample->pdf;
      sample->pdf *= scale;
      sample->weight *= 1 / scale;
      *density_scale = scale;
      *roulette_scale *= scale * sample->eta_scale;
    } else if (sample) {
      *roulette_scale *= sample->eta_scale;
    }
    return sample;
  } else {
    const std::optional<BsdfSampleOf<Color>> sample = SampleScattering(u);
    if (sample) *roulette_scale *= sample->eta_scale;
    return sample;
  }
}

template <typename C>
bool SurfaceVertex<C>::Scatter(const Context<C>& c, PathState<C>* path) const {
  const std::array<float, 4> u = c.sampler.Get4(Slot(LastVertexIndex(*path), VertexSlot::kBsdf));
  float roulette_scale = path->roulette_scale, density_scale = 1;
  const auto sample = SampleDirection(u, &density_scale, &roulette_scale);
  if (!sample.has_value()) return false;
  const Vec3f wi = point.shading.ToWorld(sample->wi);
  if (!AgreesOnSide(sample->wi.z, Dot(wi, point.ng))) return false;
  if constexpr (C::kGuided) NoteGuiding(guided, density_scale, path);
  path->throughput *= sample->weight;
  if (path->throughput.IsBlack()) return false;
  NoteScattering(c, *this, wi, sample->pdf, sample->flags, sample->eta_scale, path);
  if constexpr (C::kChains) NoteChainScattering(c, *this, sample->flags, path);
  path->roulette_scale = roulette_scale;
  return Continue(c, wi, *sample, u[3], path);
}

template <typename C>
bool SurfaceVertex<C>::ScatterFromLight(const Context<C>& c, PathState<C>* path) const {
  const std::array<float, 4> u = c.sampler.Get4(Slot(LastVertexIndex(*path), VertexSlot::kBsdf));
  const std::optional<BsdfSampleOf<Color>> sample = SampleScattering(u);
  if (!sample.has_value()) return false;
  const Vec3f w = point.shading.ToWorld(sample->wi);
  if (!AgreesOnSide(sample->wi.z, Dot(w, point.ng))) return false;
  LightEnd& end = path->other_end;
  const bool is_specular = (sample->flags & kBsdfSpecular) != 0;
  const float flux = FluxFactor(w, *path);
  const double cosines = 1 / static_cast<double>(flux);
  StepDensities step;
  if (is_specular) {
    if (!IsReversible(c, w, sample->flags)) return false;
    // Radiance changes by 1 / eta^2 where it is refracted, flux does not.
    const float shading = IsHair<C::kTraits>(bsdf) ? 1 : std::fabs(wo_local.z / sample->wi.z);
    path->throughput *= sample->weight * (sample->eta_scale * shading * flux);
    step = SpecularStep(static_cast<double>(ScatteringShare()),
                        1 / static_cast<double>(sample->eta_scale), static_cast<double>(shading),
                        cosines);
  } else {
    const BsdfValueOf<Color> value = SeenFrom(c, w).Eval(-path->ray.d);
    path->throughput *= value.f_cos * (flux / sample->pdf);
    step = {static_cast<double>(value.pdf), static_cast<double>(sample->pdf), cosines};
  }
  if (path->throughput.IsBlack()) return false;
  if (end.is_first) end.is_specular_first = is_specular;
  const bool is_first = end.is_first;
  NoteScatteringFromLight(step, is_specular, &end);
  const bool continues = Continue(c, w, *sample, u[3], path);
  if constexpr (C::kCountsSplits && C::kSubsurface) {
    if (is_first && path->media.properties.is_subsurface) LeaveBySubsurface(&end);
  }
  return continues;
}

template <typename C>
inline bool SurfaceVertex<C>::Continue(const Context<C>& c, Vec3f wi,
                                       const BsdfSampleOf<Color>& sample, float u_roulette,
                                       PathState<C>* path) const {
  if constexpr (C::kMedia) {
    if (!EnterSide(c, wi, *path, &path->media)) return false;
  }
  if constexpr (C::kSubsurface) StartSubsurfaceWalk(point, path);
  if constexpr (C::kBothEnds && C::kTexturedSubsurface) {
    if (!EnterTexturedSubsurface(path)) return false;
  }
  if constexpr (C::kLines) path->media.line.has_scattered = false;
  path->specular = (sample.flags & kBsdfSpecular) != 0;
  path->history.AddSurface(path->specular);
  path->pdf = sample.pdf;
  path->from = point.p;
  path->from_n = light_hint;
  RememberLights(guided, path);
  if constexpr (C::kSplitsLights) path->splits = splits;
  if constexpr (C::kProduct) path->sketch = sketch;
  if constexpr (C::kRayKinds) {
    BeginScatteredRay(*this, wi, path->specular, {sample.pdf, u_roulette},
                      c.scene.visibility.splits_lobes, path);
  }
  Leave(point, wi, &path->ray);
  path->ray.d = wi;
  // Prefetches the radiance of infinite lights, in case the ray hits nothing.
  path->sky_place = c.scene.lights->template PrepareEnvironment<C::kTraits>(wi);
  // Remember the direction, and learn later what light came from there.
  if constexpr (C::kGuided) NoteDirection(c, *this, *path);
  return SurvivesRoulette(c, u_roulette, path);
}

}  // namespace sheaf::render
