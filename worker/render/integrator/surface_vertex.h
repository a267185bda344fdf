// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SurfaceVertex: a vertex of a path on a surface, as a scatterer. MediumVertex has the same
// members, so that direct lighting and the integrator's loop are written once for both.
#pragma once

#include <array>
#include <optional>
#include <type_traits>

#include "common/film/film_tile.h"
#include "worker/render/bsdf/perturbed_normal.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/integrator/first_hit.h"
#include "worker/render/integrator/light_draw.h"
#include "worker/render/integrator/medium_boundaries.h"
#include "worker/render/integrator/mis_weights.h"
#include "worker/render/integrator/russian_roulette.h"
#include "worker/render/integrator/subsurface_walk.h"
#include "worker/render/integrator/visibility.h"

namespace sheaf::render {

template <typename C>
struct SurfaceVertex {
  using Color = typename C::Color;
  using OptionalNormal = StateIf<C::kNormalMaps, PerturbedNormal>;
  using Plane = StateIf<C::kNormalMaps, std::optional<TangentPlane>>;

  // The hit of the path's ray; `bsdf` and what follows it are set later.
  SurfaceVertex(const Context<C>& c, const RawHit& hit, const PathState<C>& path)
      // Prefetches the light, before the surface is known.
      : draw(DrawLight(c, NextVertexIndex(path))),
        point(MakeSurfacePoint<C::kTraits>(c.scene.geometry, path.ray, hit, &plane)) {}

  LightDraw draw;
  Plane plane;
  SurfacePoint point;
  NullInterfaceChoice choice{};
  bool in_subsurface = false;  // Met from inside a subsurface medium.
  BsdfOf<Color> bsdf;
  [[no_unique_address]] OptionalNormal perturbed_normal;
  Vec3f wo_local;
  Vec3f light_hint{};  // Lights behind this normal do not contribute; zero if all may.

  // Sets the shading frame, for a path that arrives along -wo. Call once, after the BSDF is known.
  void Prepare(const Context<C>& c, Vec3f wo, const PathState<C>& path);
  // Records the vertex and counts it. False where the path ends.
  bool Arrive(const Context<C>& c, PathState<C>* path, FilmSample* film);

  bool SamplesLights(const PathState<C>&) const { return !bsdf.specular; }
  const LightDraw& Draw(const Context<C>&, const PathState<C>&) const { return draw; }
  // f * |cos| and the pdf of scattering towards w, per solid angle.
  BsdfValueOf<Color> Eval(Vec3f w) const;
  // Changes *media to those on the side of w. False where no light arrives from there.
  bool EnterSide(const Context<C>& c, Vec3f w, const PathState<C>& path,
                 MediumState<C>* media) const {
    return render::EnterSide(c, point, w, IsHair<C::kTraits>(bsdf), path, media);
  }
  // The weight of a light sample, where scattering towards the light has density pdf.
  float LightSampleWeight(const Context<C>&, const LightSampleOf<Color>& light, float pdf,
                          const PathState<C>&) const {
    return light.is_delta ? 1.0f : MisWeight<C>(Technique::kLight, light.pdf, pdf);
  }
  LightPathKind LightKind(const PathState<C>& path) const { return path.history.KindFromSurface(); }
  // Samples the next ray of the path. False where the path ends.
  bool Scatter(const Context<C>& c, PathState<C>* path) const;

 private:
  // Perturbs the shading frame by the material's map.
  OptionalNormal PerturbNormal(const Context<C>& c, const TangentPlane& tangents, Vec3f wo,
                               const PathState<C>& path);
  // Shading and geometric normal must agree on the side of a direction, given its cosines with
  // them, or light would leak through the surface. Tilted normals handle that themselves, and light
  // passes through hair.
  bool AgreesOnSide(float cos_shading, float cos_geometric) const {
    if constexpr (C::kNormalMaps) {
      if (perturbed_normal.active()) return true;
    }
    return IsHair<C::kTraits>(bsdf) || cos_shading * cos_geometric > 0;
  }
  Rgb Albedo(const Context<C>& c) const;
};

template <typename C>
typename SurfaceVertex<C>::OptionalNormal SurfaceVertex<C>::PerturbNormal(
    const Context<C>& c, const TangentPlane& tangents, Vec3f wo, const PathState<C>& path) {
  TangentPlane seen = tangents;
  seen.n = ToDouble(point.shading.n);
  const Vec3f mapped = c.scene.materials->ShadingNormal(point.surface->material,
                                                        TexturePointOf(c, point), choice.mix, seen);
  const Vec3f n = BendNormal(LiftNormal(mapped, point.ng), point.ng, wo);
  point.shading = internal::ShadingFrame(n, seen);
  if (n == point.ng) return {};
  const std::array<float, 4> u = c.sampler.Get4(Slot(NextVertexIndex(path), VertexSlot::kSurface));
  return {point.shading.ToLocal(point.ng), {u[2], u[3]}};
}

template <typename C>
void SurfaceVertex<C>::Prepare(const Context<C>& c, Vec3f wo,
                               [[maybe_unused]] const PathState<C>& path) {
  // A shading normal seen from below its own horizon is meaningless: the geometric one replaces it.
  const bool is_hair = IsHair<C::kTraits>(bsdf);
  if (!is_hair && Dot(wo, point.shading.n) * Dot(wo, point.ng) <= 0) {
    point.shading = Frame::FromNormal(point.ng);
  }
  if constexpr (C::kNormalMaps) {
    if (plane && !is_hair) perturbed_normal = PerturbNormal(c, *plane, wo, path);
  }
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
  return true;
}

template <typename C>
inline BsdfValueOf<typename C::Color> SurfaceVertex<C>::Eval(Vec3f w) const {
  const Vec3f wi_local = point.shading.ToLocal(w);
  if (!AgreesOnSide(wi_local.z, Dot(w, point.ng))) return {};
  if constexpr (C::kNormalMaps) {
    if (perturbed_normal.active())
      return perturbed_normal.template Eval<C::kTraits>(bsdf, wo_local, wi_local);
  }
  return EvalBsdf<C::kTraits>(bsdf, wo_local, wi_local);
}

template <typename C>
bool SurfaceVertex<C>::Scatter(const Context<C>& c, PathState<C>* path) const {
  const std::array<float, 4> u = c.sampler.Get4(Slot(LastVertexIndex(*path), VertexSlot::kBsdf));
  const std::optional<BsdfSampleOf<Color>> sample = [&] {
    if constexpr (C::kNormalMaps) {
      if (perturbed_normal.active()) {
        return perturbed_normal.template Sample<C::kTraits>(bsdf, wo_local, u[2], {u[0], u[1]});
      }
    }
    return SampleBsdf<C::kTraits>(bsdf, wo_local, u[2], {u[0], u[1]});
  }();
  if (!sample.has_value()) return false;
  const Vec3f wi = point.shading.ToWorld(sample->wi);
  if (!AgreesOnSide(sample->wi.z, Dot(wi, point.ng))) return false;
  path->throughput *= sample->weight;
  if (path->throughput.IsBlack()) return false;
  if constexpr (C::kMedia) {
    if (!EnterSide(c, wi, *path, &path->media)) return false;
  }
  if constexpr (C::kSubsurface) StartSubsurfaceWalk(point, path);
  if constexpr (C::kLines) path->media.line.has_scattered = false;
  path->eta_scale *= sample->eta_scale;
  path->specular = (sample->flags & kBsdfSpecular) != 0;
  path->history.AddSurface(path->specular);
  path->pdf = sample->pdf;
  path->from = point.p;
  path->from_n = light_hint;
  path->ray.o = OffsetRayOrigin(point.p, point.p_error, point.ng, wi);
  path->ray.d = wi;
  path->ray.source = point.id;
  // Prefetches the radiance of infinite lights, in case the ray hits nothing.
  path->sky_place = c.scene.lights->template PrepareEnvironment<C::kTraits>(wi);
  return SurvivesRoulette(c, u[3], path);
}

}  // namespace sheaf::render
