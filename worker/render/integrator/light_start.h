// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// StartAtLight: begins a light path, at a light (LightEmission) or in the emission of media
// (EmissionPoints). The flux of a path that begins in media is the emission at its point, per
// volume and solid angle, over the density of both.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "worker/render/integrator/heterogeneous_transport.h"
#include "worker/render/integrator/medium_boundaries.h"
#include "worker/render/integrator/two_ends.h"
#include "worker/render/integrator/visibility.h"

namespace sheaf::render {

// Rays of a light without a surface begin at this multiple of the rounding of its position.
inline constexpr float kErrorsFromLight = 8;

// The point of an emitter that a path leaves.
struct EmitterStart {
  Vec3f p, n;
  uint32_t emitter = 0;
  PrimitiveId id;
};

// Makes the ray leave the emitter towards w. Other surfaces may lie in its plane: the ceiling that
// a lamp is let into, or the face of a medium that fills the room.
inline EmitterStart LeaveEmitter(const SceneGeometry& geometry, Vec3f p, Vec3f p_error, Vec3f n,
                                 uint32_t emitter, PrimitiveId id, Vec3f w, Ray* ray) {
  ray->source = id;
  BeginBefore(p, p_error, n, Gamma(64) * Dot(Abs(n), geometry.reach), w, ray);
  return {p, n, emitter, id};
}

// Sets the media at the start of the path's ray: those at the camera, changed by every surface in
// between. start: null where the path leaves no surface. False where there are too many.
template <typename C>
bool StartInMediaAtLight(const Context<C>& c, const EmitterStart* start, PathState<C>* path) {
  if (!c.scene.media) return true;
  StartInMedia(c, path);
  const FrameSettings& settings = c.scene.settings;
  Ray ray = c.scene.camera.template MakeRay<C::kTraits>(
      {settings.width_px / 2.0, settings.height_px / 2.0}, {0.5f, 0.5f}, path->ray.time);
  const Vec3f target = start == nullptr ? path->ray.o : start->p;
  const Vec3f towards = target - ray.o;
  ray.t_max = 1;
  if (start != nullptr) {
    ray.end = Ray::End::kEmitter;
    ray.end_emitter = start->emitter;
  }
  for (uint32_t crossing = 0; crossing < kNullCrossingsMax; ++crossing) {
    ray.d = target - ray.o;
    ++c.counts.rays;
    RawHit hit;
    if (!(Dot(ray.d, towards) > 0) || !c.tracer.Intersect(ray, &hit)) {
      if (start != nullptr && Dot(start->n, towards) * Dot(start->n, path->ray.d) > 0) {
        // The path leaves the emitter on its far side.
        hit.t = 1;
        hit.id = start->id;
        ray.d = towards;
        const SurfacePoint point = MakeSurfacePoint<C::kTraits>(c.scene.geometry, ray, hit);
        if (!CrossBoundary(c, point, towards, *path, &path->media)) return false;
      }
      path->media.last = {};
      return true;
    }
    const SurfacePoint point = MakeSurfacePoint<C::kTraits>(c.scene.geometry, ray, hit);
    if (!CrossBoundary(c, point, ray.d, *path, &path->media)) return false;
    Leave(point, ray.d, &ray);
  }
  return false;
}

// The fraction of the ray's power that the cut-out of its light leaves.
template <typename C>
float CutOutOf([[maybe_unused]] const Context<C>& c,
               [[maybe_unused]] const EmittedRayOf<typename C::Color>& emitted) {
  if constexpr (C::kNullInterfaces && C::Has(Trait::kTexturedEmission)) {
    if (emitted.cut_out != kNone) {
      LightSampleOf<typename C::Color> at;
      at.p_light = emitted.p;
      at.cut_out = emitted.cut_out;
      at.uv = emitted.uv;
      return CutOutTransmittance(c, at);
    }
  }
  return 1;
}

// Sets the flux of a path that leaves a light with the pdf. False where it is 0.
template <typename C>
bool SetFlux(const typename C::Color& power, double pdf, PathState<C>* path) {
  float largest = 0;
  for (size_t i = 0; i < kComponentCount<typename C::Color>; ++i) {
    largest = std::max(largest, std::fabs(power[i]));
  }
  if (!(largest > 0)) return false;
  // Roulette needs a throughput that begins near 1.
  path->throughput = power * (1 / largest);
  path->other_end.scale = static_cast<double>(largest) / pdf;
  return true;
}

// The emission of all media at the point of render space, per volume and solid angle.
template <typename C>
typename C::Color EmissionAt([[maybe_unused]] const Context<C>& c, [[maybe_unused]] Vec3f p,
                             const PathState<C>& path) {
  using Color = typename C::Color;
  Color sum = path.media.properties.emission;
  if constexpr (C::kHeterogeneous) {
    if (!path.media.properties.has_emissive_grid) return sum;
    const MediumTable& media = *c.scene.media;
    const auto time = TimeOfMedia<C::kTraits>(path.ray.time);
    const auto add = [&](MediumTable::PartId part) {
      const MediumEmission* emission = media.MediumEmissionOf(part);
      if (emission == nullptr) return;
      const HeterogeneousMedium& medium = media.DensityOf(part);
      const double density = medium.DensityAt(ToDouble(p), time);
      if (!(density > 0)) return;
      const auto its =
          media.template CoefficientsOf<Color>(part, path.wavelengths, path.media.properties.form);
      const Vec3d origin = medium.OriginOf(ToDouble(p), time);
      sum += emission->template At<Color>(origin, path.wavelengths) * its.sigma_a *
             static_cast<float>(density);
    };
    const MediumTable::PartList parts = media.PartsOf(path.media.set);
    for (uint32_t i = 0; i < parts.size(); ++i) {
      if (!parts.IsMerged(i)) {
        add(parts[i]);
        continue;
      }
      for (const MergedMedium::Member& member : media.MergedAt(parts[i].medium).members()) {
        add({member.medium, member.part});
      }
    }
  }
  return sum;
}

// The start of a path in the emission of media.
template <typename C>
bool StartInEmission(const Context<C>& c, const GuidedEmission::MediaStart& start,
                     PathState<C>* path) {
  // The first of the slot's numbers has chosen media.
  const std::array<float, 4> position = c.sampler.Get4(Slot(CameraSlot::kEmitter));
  const EmissionPoints::Point point =
      c.scene.emission_points->Sample(start.choice, {position[1], position[2], position[3]});
  const double pdf = start.probability * point.pdf / (4 * kPi);
  if (!(pdf > 0) || !std::isfinite(pdf)) return false;
  path->is_camera_path = false;
  path->ray.o = point.p;
  path->ray.d = start.w;
  if (!StartInMediaAtLight(c, nullptr, path) || !c.scene.media->BeginsLightPaths(path->media.set)) {
    return false;
  }
  const typename C::Color emitted = EmissionAt(c, point.p, *path);
  if (!IsFinite(emitted) || !SetFlux(emitted, pdf, path)) return false;
  LightEnd& end = path->other_end;
  end.is_medium = true;
  end.can_be_hit = true;
  end.p = point.p;
  return true;
}

// Samples the ray with which the path leaves a light. False where it carries nothing.
template <typename C>
bool StartAtLight(const Context<C>& c, PathState<C>* path) {
  using Color = typename C::Color;
  const std::array<float, 4> u = c.sampler.Get4(Slot(CameraSlot::kFilterAndLens));
  const EmissionUniforms uniforms{
      c.sampler.Get1(Slot(CameraSlot::kEmitter)), {u[0], u[1]}, {u[2], u[3]}};
  if constexpr (C::kMedia && C::Has(Trait::kEmissiveMedia)) {
    if (const std::optional<GuidedEmission::MediaStart> media = c.emission.StartInMedia(uniforms)) {
      return StartInEmission(c, *media, path);
    }
  }
  const std::optional<EmittedRayOf<Color>> emitted =
      c.emission.template SampleLe<Color>(uniforms, path->wavelengths);
  if (!emitted) return false;
  if (!SetFlux(emitted->power * CutOutOf(c, *emitted), emitted->pdf, path)) return false;
  LightEnd& end = path->other_end;
  end.light = emitted->light;
  end.p = emitted->p;
  end.n = emitted->n;
  const LightEmission& emission = c.emission.lights();
  end.is_infinite = emission.IsInfinite(end.light);
  end.can_be_hit = end.is_infinite || (emission.IsSurface(end.light) && !emitted->is_unseen);
  path->is_camera_path = false;
  path->ray.d = emitted->w;
  std::optional<EmitterStart> start;
  if (emitted->is_infinite) {
    path->ray.o = emitted->p;
  } else if (emission.IsSurface(end.light)) {
    const std::optional<PrimitiveId> id = PrimitiveOfEmitter(c.scene.geometry, end.light);
    if (id) {
      start = LeaveEmitter(c.scene.geometry, emitted->p, emitted->p_error, emitted->n, end.light,
                           *id, emitted->w, &path->ray);
    } else {
      path->ray.o = OffsetRayOrigin(emitted->p, emitted->p_error, emitted->n, emitted->w);
    }
  } else {
    // A light without a surface may lie on a boundary: the ray must be clearly on one side.
    path->ray.o =
        OffsetRayOrigin(emitted->p, emitted->p_error * kErrorsFromLight, emitted->w, emitted->w);
  }
  if constexpr (C::kMedia) return StartInMediaAtLight(c, start ? &*start : nullptr, path);
  return true;
}

}  // namespace sheaf::render
