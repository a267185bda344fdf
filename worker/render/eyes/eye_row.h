// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TraceEyeRow: the paths of one eye through a row of its pixels, for the generated files that
// compile the variants.
#pragma once

#include <optional>
#include <variant>

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/eyes/eye_variants.h"
#include "worker/render/eyes/shared_vertex.h"
#include "worker/render/eyes/specular_prefix.h"

namespace sheaf::render {

// Follows a path to its end. Sets *shift.
template <typename C>
void FollowSharedPath(const Context<C>& c, const PathSharing& sharing, const PathOrigin& origin,
                      PathState<C>* path, FilmSample* film, PathShift<C>* shift) {
  const auto wavelengths = path->wavelengths;
  Vertex<C> vertex;
  NextVertex(c, path, &vertex);
  SurfaceVertex<C>* const surface = ClearSurface(*path, &vertex);
  if (surface != nullptr && surface->bsdf.specular) {
    FollowSpecularPath(c, sharing, origin, wavelengths, &vertex, path, film, shift);
    return;
  }
  const bool continues = surface != nullptr
                             ? ScatterFirst(c, sharing, origin, *surface, shift, path, film)
                             : ContinueFrom(c, &vertex, path, film);
  if (continues) FollowPath(c, path, film);
}

template <TraitBits kTraits, typename Tracer>
class EyeIntegrator {
 public:
  using C = IntegratorConfig<kTraits, Tracer, DirectLight::kByBoth, PathKind::kEye>;

  // All must outlive *this. Not thread-safe: one for each thread.
  EyeIntegrator(const CompiledScene& scene, const PathSharing& sharing, Tracer& tracer,
                RayCounts& counts)
      : scene_(scene), sharing_(sharing), tracer_(tracer), counts_(counts) {}

  // A pure function of (scene, eye, pixel, sample_index), valid until the next call. x: of the
  // eye's own film.
  const SharedSample& TraceSample(Eye eye, int32_t x, int32_t y, uint64_t sample_index) {
    const int32_t column = eye == Eye::kLeft ? x : x + FilmWidthOf(scene_);
    const Sampler sampler(scene_.settings.seed, column, y, sample_index,
                          scene_.settings.one_sequence);
    const Context<C> context{scene_, tracer_, sampler, counts_, nullptr, groups_, {}, {}};
    const Camera& camera = CameraOf(scene_, eye);
    sample_.own = {};
    PathOrigin origin{eye};
    if constexpr (C::Has(Trait::kLens)) {
      const std::array<float, 4> u = sampler.Get4(Slot(CameraSlot::kFilterAndLens));
      origin.lens = {u[2], u[3]};
    }
    float time = 0;
    if constexpr (C::Has(Trait::kMotion)) {
      origin.time_u = sampler.Get1(Slot(CameraSlot::kTime));
      time = camera.ShutterFraction(origin.time_u);
    }
    PathState<C> path;
    float weight = 1;
    path.ray = MakeCameraRay<C>(scene_, camera, sampler, {x, y}, time, &sample_.own, &weight);
    path.camera_o = camera.EyeOf(path.ray);
    if constexpr (C::Has(Trait::kLens)) {
      if (const std::optional<Vec2f> lens = camera.LensSampleOf(path.ray)) origin.lens = *lens;
    }
    if constexpr (C::Has(Trait::kEnvironment)) path.from = path.ray.o;
    if constexpr (C::kSpectral) {
      path.wavelengths = scene_.wavelengths.Sample(sampler.Get1(Slot(CameraSlot::kWavelength)));
    }
    if constexpr (C::kMedia) StartInMedia(context, &path);
    shift_.count = 0;
    shift_.is_behind_prefix = false;
    // Rays that the lens blocks are black samples.
    if (weight != 0) {
      FollowSharedPath(context, sharing_, origin, &path, &sample_.own, &shift_);
    }
    SetShares(path, FilmPointOf(sampler, x, y), weight, eye);
    return sample_;
  }

 private:
  using Color = typename C::Color;

  // The point of the path's ray on the film.
  Vec2d FilmPointOf(const Sampler& sampler, int32_t x, int32_t y) const {
    Vec2f u;
    if constexpr (C::Has(Trait::kLens)) {
      const std::array<float, 4> all = sampler.Get4(Slot(CameraSlot::kFilterAndLens));
      u = {all[0], all[1]};
    } else {
      u = sampler.Get2(Slot(CameraSlot::kFilterAndLens));
    }
    const Vec2f offset = scene_.filter.Sample(u).offset;
    return {x + 0.5 + static_cast<double>(offset.x), y + 0.5 + static_cast<double>(offset.y)};
  }
  // Sets what the path brings: radiances, shares and places. film: the point of its ray. weight:
  // that of the ray.
  void SetShares(const PathState<C>& path, Vec2d film, float weight, Eye eye) {
    const auto found = [&](const Color& first, const Color& factor) {
      return scene_.film.Of(first + factor * path.radiance, path.wavelengths);
    };
    FilmSample& own = sample_.own;
    sample_.place_count = 0;
    sample_.own_share = 1;
    if (shift_.count == 0) {
      own.radiance = found(Color(), Color::Gray(1));
      if constexpr (C::Has(Trait::kLens)) own.radiance *= weight;
      if (sharing_.by_filter) PlaceAt(eye, film);
      return;
    }
    auto& own_view = shift_.views[0];
    if (shift_.is_behind_prefix) own_view.light += shift_.alone * (own_view.share * weight);
    int32_t v = 0;
    if (!sharing_.by_filter) {
      own.radiance = found(own_view.light, own_view.factor);
      sample_.own_share = own_view.share;
      v = 1;
    } else {
      sample_.own_share = 0;
    }
    for (; v < shift_.count; ++v) {
      const auto& view = shift_.views[static_cast<size_t>(v)];
      sample_.places[static_cast<size_t>(sample_.place_count++)] = {
          view.eye, view.film, found(view.light, view.factor), view.normal, view.depth, view.share};
    }
  }
  // Moves the path's own sample from its pixel to all whose filters cover the point.
  void PlaceAt(Eye eye, Vec2d film) {
    const FilmSample& own = sample_.own;
    const double samples =
        scene_.filter.SamplesAt(film, FilmWidthOf(scene_), scene_.settings.height_px);
    if (!(samples > 0)) return;
    const auto share = static_cast<float>(1 / samples);
    sample_.own_share = 0;
    sample_.place_count = 1;
    sample_.places[0] = {eye, film, own.radiance * share, own.normal, own.depth, share};
  }

  const CompiledScene& scene_;
  const PathSharing& sharing_;
  Tracer& tracer_;
  RayCounts& counts_;
  LightGroups<Color> groups_;
  SharedSample sample_;
  PathShift<C> shift_;
};

template <TraitBits kTraits>
void TraceEyeRow(const CompiledScene& scene, const PathSharing& sharing, Eye eye, int32_t y,
                 uint64_t pass, EyeSink* sink, RayCounts* counts) {
  RayCounts local;
  local.majorant_factor = counts->majorant_factor;
  EyeIntegrator<kTraits, const EmbreeScene> tracer(scene, sharing, *scene.tracer, local);
  const int32_t width_px = FilmWidthOf(scene);
  for (int32_t x = 0; x < width_px; ++x) {
    sink->Add(eye, x, y, tracer.TraceSample(eye, x, y, pass));
  }
  counts->Add(local);
}

}  // namespace sheaf::render
