// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TraceEyeRow: the paths of one eye through a row of its pixels, for the generated files that
// compile the variants.
#pragma once

#include <variant>

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/eyes/eye_variants.h"
#include "worker/render/eyes/other_eye.h"

namespace sheaf::render {

// Follows the path of an eye to its end. Sets *shift.
template <typename C>
void FollowEyePath(const Context<C>& c, Eye eye, Vec2f lens, PathState<C>* path, FilmSample* film,
                   EyeShift<C>* shift) {
  Vertex<C> vertex;
  NextVertex(c, path, &vertex);
  auto* surface = std::get_if<SurfaceVertex<C>>(&vertex);
  // In a medium, a path would come with a probability of its own.
  bool is_clear = surface != nullptr;
  if constexpr (C::kMedia) is_clear = is_clear && path->media.set.empty();
  const bool continues = is_clear ? ScatterFirst(c, eye, lens, *surface, shift, path, film)
                                  : ContinueFrom(c, &vertex, path, film);
  if (continues) FollowPath(c, path, film);
}

template <uint32_t kTraits, typename Tracer>
class EyeIntegrator {
 public:
  using C = IntegratorConfig<kTraits, Tracer, DirectLight::kByBoth, PathKind::kEye>;

  // All three must outlive *this. Not thread-safe: one for each thread.
  EyeIntegrator(const CompiledScene& scene, Tracer& tracer, RayCounts& counts)
      : scene_(scene), tracer_(tracer), counts_(counts) {}

  // A pure function of (scene, eye, pixel, sample_index). x: of the eye's own film.
  EyeSample TraceSample(Eye eye, int32_t x, int32_t y, uint64_t sample_index) {
    const int32_t column = eye == Eye::kLeft ? x : x + scene_.eyes->width_px;
    const Sampler sampler(scene_.settings.seed, column, y, sample_index,
                          scene_.settings.one_sequence);
    const Context<C> context{scene_, tracer_, sampler, counts_, nullptr, groups_, {}, {}};
    const Camera& camera = scene_.eyes->of(eye);
    EyeSample sample;
    PathState<C> path;
    const float time =
        C::Has(Trait::kMotion) ? camera.ShutterFraction(sampler.Get1(Slot(CameraSlot::kTime))) : 0;
    path.ray = MakeCameraRay<C>(scene_, camera, sampler, {x, y}, time, &sample.own, nullptr);
    path.camera_o = camera.EyeOf(path.ray);
    if constexpr (C::Has(Trait::kEnvironment)) path.from = path.ray.o;
    if constexpr (C::kSpectral) {
      path.wavelengths = scene_.wavelengths.Sample(sampler.Get1(Slot(CameraSlot::kWavelength)));
    }
    if constexpr (C::kMedia) StartInMedia(context, &path);
    Vec2f lens;
    if constexpr (C::Has(Trait::kLens)) {
      const std::array<float, 4> u = sampler.Get4(Slot(CameraSlot::kFilterAndLens));
      lens = {u[2], u[3]};
    }
    EyeShift<C> shift;
    FollowEyePath(context, eye, lens, &path, &sample.own, &shift);
    const auto found = [&](const typename C::Color& first, const typename C::Color& factor) {
      return scene_.film.Of(first + factor * path.radiance, path.wavelengths);
    };
    sample.own.radiance = found(shift.own, shift.own_factor);
    sample.own_share = shift.own_share;
    if (!shift.is_shifted) return sample;
    sample.is_shifted = true;
    sample.film = shift.film;
    sample.other = sample.own;
    sample.other.radiance = found(shift.other, shift.other_factor);
    sample.other.normal = shift.normal;
    sample.other.depth = shift.depth;
    sample.other_share = shift.other_share;
    return sample;
  }

 private:
  const CompiledScene& scene_;
  Tracer& tracer_;
  RayCounts& counts_;
  LightGroups<typename C::Color> groups_;
};

template <uint32_t kTraits>
void TraceEyeRow(const CompiledScene& scene, Eye eye, int32_t y, uint64_t pass, EyeSink* sink,
                 RayCounts* counts) {
  RayCounts local;
  local.majorant_factor = counts->majorant_factor;
  EyeIntegrator<kTraits, const EmbreeScene> tracer(scene, *scene.tracer, local);
  for (int32_t x = 0; x < scene.eyes->width_px; ++x) {
    sink->Add(eye, x, y, tracer.TraceSample(eye, x, y, pass));
  }
  counts->Add(local);
}

}  // namespace sheaf::render
