// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LogDensityOf: the density with which a technique finds a stored path, computed directly from its
// positions, normals, BSDFs, light and camera, in double precision and without recurrences: what
// the running densities of the integrator are held against. docs/adr/0127.
//
// Densities are per area of each vertex on a surface, per volume of each vertex in a medium, per
// solid angle of light at infinity and of the emission of media, and logarithms. Left out are those
// of distances in media and of the point on the lens, which all techniques share, and the
// probabilities of specular lobes, which are the same in both directions.
//
// Specular vertices have infinite densities. Those of directions w are taken over the density of
// the half vector, as the limit of ever smoother surfaces: n^2 |cos w|, with n the index of
// refraction of the side of w, and the shading normal. Source: Walter et al. 2007, sec. 4.2.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <variant>
#include <vector>

#include "common/math/elementary.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/densities/weights.h"
#include "worker/render/integrator/light_path.h"

namespace sheaf::render {

// The path from the lens through places x1, x2 ... x(k-1) to the light xk.
template <TraitBits kTraits>
struct StoredPath {
  using FromLens = IntegratorConfig<kTraits, const EmbreeScene, DirectLight::kByBoth,
                                    PathKind::kCameraBesideLight>;
  using FromLight =
      IntegratorConfig<kTraits, const EmbreeScene, DirectLight::kByBoth, PathKind::kLight>;

  struct Place {
    Vertex<FromLens> from_lens;    // As a path from the lens meets it.
    Vertex<FromLight> from_light;  // As a path from the light meets it.
    bool is_specular = false;
    // Where specular: (index on the light's side / index on the lens's side)^2.
    double eta_scale = 1;
    // In a medium: where the part of the segment from the lens that leads here begins, behind the
    // last surface.
    Vec3d segment_start{};
  };

  Ray camera_ray;
  std::vector<Place> places;
  LightEnd light;
  Vec3f towards_light;                // For light at infinity and the emission of media.
  MediumState<FromLight> last_media;  // At the last place.
  double merge_radius = 0;            // For FindsBy::kMerge.
};

// Calls f with the vertex, which is on a surface or in a medium.
template <typename C, typename F>
auto WithScatterer(const Vertex<C>& vertex, const F& f) {
  if constexpr (C::kMedia) {
    if (const auto* medium = std::get_if<MediumVertex<C>>(&vertex)) return f(*medium);
  }
  return f(std::get<SurfaceVertex<C>>(vertex));
}

template <TraitBits kTraits>
class PathDensities {
 public:
  using FromLens = typename StoredPath<kTraits>::FromLens;
  using FromLight = typename StoredPath<kTraits>::FromLight;

  PathDensities(const StoredPath<kTraits>& path, const CompiledScene& scene)
      : path_(path), scene_(scene), last_(path.places.size() - 1) {}

  double LogHit() const {
    if (!path_.light.can_be_hit) return -kInfinity;
    return LogFromLensTo(last_) + LogForward(last_) + LogArrivalAtLight();
  }
  double LogLightSample() const {
    if (path_.places[last_].is_specular) return -kInfinity;
    return LogFromLensTo(last_) + std::log(LightPdf()) +
           (path_.light.can_be_hit ? LogArrivalAtLight() : 0);
  }
  // By a line from the start of the segment to the last place, without end; of its distance, that
  // of a path which scatters there is left out, as for the other techniques.
  double LogLine() const {
    const double sample = LogLightSample();
    if constexpr (FromLens::kLines) {
      const bool has_place = !path_.light.is_infinite && !path_.light.is_medium;
      if (sample > -kInfinity && IsMedium(last_) && has_place) return sample + LogLineOverSample();
    }
    return -kInfinity;
  }
  // By a light path that arrives within the radius of the first rough place behind specular ones.
  double LogMerge() const {
    size_t first = 0;
    while (first <= last_ && path_.places[first].is_specular) ++first;
    if (first == 0 || first > last_) return -kInfinity;
    double log = std::log(scene_.light_paths_per_pass / scene_.gather_step * kPi *
                          path_.merge_radius * path_.merge_radius) +
                 LogFromLensTo(first) + LogStart();
    for (size_t i = last_; i > first; --i) log += LogBackward(i) + LogArrival(i - 1, i);
    return log;
  }
  // Whether the path meets a surface at grazing, or has a short segment. Its points and normals are
  // rounded differently from both ends, which decides its cosines and directions then.
  bool IsGrazing() const {
    for (size_t i = 0; i <= last_; ++i) {
      const Vec3d before =
          i > 0 ? Towards(i, i - 1) : Normalize(ToDouble(path_.camera_ray.o) - At(0));
      const Vec3d after = i < last_ ? Towards(i, i + 1) : TowardsLight();
      const double length = i < last_    ? Length(At(i + 1) - At(i))
                            : HasPoint() ? Length(ToDouble(path_.light.p) - At(i))
                                         : kInfinity;
      if (length < kLengthMin) return true;
      if (IsMedium(i)) continue;
      for (const Vec3d& w : {before, after}) {
        if (std::min(LogCosine(i, w), LogShadingCosine(i, w)) < std::log(kCosineMin)) return true;
      }
    }
    const bool has_line = IsMedium(last_);
    if (has_line && Length(At(last_) - path_.places[last_].segment_start) < kLengthMin) return true;
    return IsSurface() && LogOfDot(path_.light.n, TowardsLight()) < std::log(kCosineMin);
  }
  double LogLightPath() const {
    double log = std::log(scene_.light_paths_per_pass) + LogStart();
    for (size_t i = last_; i > 0; --i) log += LogBackward(i) + LogArrival(i - 1, i);
    return log;
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  static constexpr double kCosineMin = 0.1, kLengthMin = 0.1;

  static double LogOfDot(Vec3f n, Vec3d w) { return std::log(std::fabs(Dot(ToDouble(n), w))); }
  Vec3d At(size_t i) const {
    return WithScatterer<FromLens>(path_.places[i].from_lens,
                                   [](const auto& at) { return ToDouble(at.point.p); });
  }
  bool IsMedium(size_t i) const {
    return !std::holds_alternative<SurfaceVertex<FromLens>>(path_.places[i].from_lens);
  }
  bool HasPoint() const { return !path_.light.is_infinite && !path_.light.is_medium; }
  bool IsSurface() const { return HasPoint() && scene_.emission->IsSurface(path_.light.light); }
  Vec3d Towards(size_t from, size_t to) const { return Normalize(At(to) - At(from)); }
  Vec3d TowardsLight() const {
    return HasPoint() ? Normalize(ToDouble(path_.light.p) - At(last_))
                      : ToDouble(path_.towards_light);
  }
  // The cosine with the geometric normal.
  double LogCosine(size_t i, Vec3d w) const {
    if (IsMedium(i)) return 0;
    return LogOfDot(std::get<SurfaceVertex<FromLens>>(path_.places[i].from_lens).point.ng, w);
  }
  double LogShadingCosine(size_t i, Vec3d w) const {
    const auto& at = std::get<SurfaceVertex<FromLens>>(path_.places[i].from_lens);
    return LogOfDot(at.point.shading.n, w);
  }
  // Takes densities of directions from `from` to those of points about `to`.
  double LogArrival(size_t to, size_t from) const {
    return LogCosine(to, Towards(from, to)) - std::log(LengthSquared(At(to) - At(from)));
  }
  double LogArrivalAtLight() const {
    if (!IsSurface()) return 0;
    const Vec3d way = ToDouble(path_.light.p) - At(last_);
    return LogOfDot(path_.light.n, Normalize(way)) - std::log(LengthSquared(way));
  }

  // The density of a path from the lens at place i, towards the next.
  double LogForward(size_t i) const {
    const Vec3d w = i < last_ ? Towards(i, i + 1) : TowardsLight();
    return WithScatterer<FromLens>(path_.places[i].from_lens, [&](const auto& at) {
      if (!path_.places[i].is_specular)
        return std::log(static_cast<double>(at.Eval(ToFloat(w)).pdf));
      return std::log(static_cast<double>(at.ScatteringShare()) * path_.places[i].eta_scale) +
             LogShadingCosine(i, w);
    });
  }
  // The density of a path from the light at place i, towards the one before.
  double LogBackward(size_t i) const {
    const Vec3d w = Towards(i, i - 1);
    if (path_.places[i].is_specular) return LogShadingCosine(i, w);
    return WithScatterer<FromLight>(path_.places[i].from_light, [&](const auto& at) {
      return std::log(static_cast<double>(at.EvalScattering(ToFloat(w)).pdf));
    });
  }
  // A path from the lens reaches all places up to that one.
  double LogFromLensTo(size_t to) const {
    const Vec3d o = ToDouble(path_.camera_ray.o);
    double log = std::log(scene_.camera.PdfWe(path_.camera_ray, ToFloat(At(0)))) +
                 LogCosine(0, Normalize(At(0) - o));
    for (size_t i = 0; i < to; ++i) log += LogForward(i) + LogArrival(i + 1, i);
    return log;
  }
  // A light path reaches the last place.
  double LogStart() const {
    const LightEmission& emission = *scene_.emission;
    const LightEnd& light = path_.light;
    const Vec3d w = TowardsLight();
    const Vec3f p = ToFloat(At(last_)), leaving = -ToFloat(w);
    double density = 0, log_square = 0;
    if (light.is_infinite) {
      for (uint32_t i = 0; i < scene_.lights->light_count(); ++i) {
        if (emission.IsInfinite(i)) density += emission.PdfLe(i, p, {}, leaving);
      }
    } else if (light.is_medium) {
      density = emission.media_probability() * scene_.emission_points->LineDensity(p, -leaving) /
                (4 * kPi);
    } else {
      density = emission.PdfLe(light.light, p, light.n, leaving);
      log_square = std::log(LengthSquared(ToDouble(light.p) - At(last_)));
    }
    return std::log(density) + LogCosine(last_, w) - log_square;
  }
  // The line to the last place without end, or as far as heterogeneous media are that alone scatter
  // on it. extinction: their mean; 0 where others scatter too.
  struct Span {
    Vec3d o, d;
    double begin = 0, end = kInfinity, extinction = 0;
    Vec3f chosen_at;  // Where the light is chosen.
  };
  Span SpanToLast() const {
    Span span;
    span.o = path_.places[last_].segment_start;
    span.d = Normalize(At(last_) - span.o);
    const auto& properties = path_.last_media.properties;
    double extinction = Mean(properties.sigma_t);
    if constexpr (FromLens::kHeterogeneousLines) {
      if (properties.gathers) {
        const auto part =
            scene_.media->EquiangularSpanOf(path_.last_media.set, span.o, span.d, kInfinity);
        extinction += part.extinction;
        if (!properties.scatters) {
          span.begin = part.begin;
          span.end = part.end;
          span.extinction = part.extinction;
        }
      }
    }
    // The middle of what the scene has of it, or nearer.
    double end = span.end;
    for (size_t a = 0; a < 3; ++a) {
      for (const Vec3f& side : {scene_.geometry.bounds_lower, scene_.geometry.bounds_upper}) {
        const double distance = (static_cast<double>(side[a]) - span.o[a]) / span.d[a];
        if (distance > 0) end = std::min(end, distance);
      }
    }
    const double middle = span.begin + 0.5 * std::min(end - span.begin, 2 / extinction);
    span.chosen_at = ToFloat(span.o + middle * span.d);
    return span;
  }
  // Colors count alike.
  template <typename Color>
  static double Mean(const Color& sigma) {
    double sum = 0;
    for (size_t i = 0; i < kComponentCount<Color>; ++i) sum += static_cast<double>(sigma[i]);
    return sum / kComponentCount<Color>;
  }
  // The density of the distance of the last place, where the medium scatters; in heterogeneous
  // media without the transmittance. 0 where lines leave it out.
  double DistanceDensity(double t) const {
    const auto& at = std::get<MediumVertex<FromLens>>(path_.places[last_].from_lens);
    const auto& properties = path_.last_media.properties;
    using Color = typename FromLens::Color;
    if (!at.scatterer) {
      return properties.scatters ? Mean(MakeColor<Color>([&](size_t i) {
        return static_cast<float>(static_cast<double>(properties.sigma_t[i]) *
                                  std::exp(-static_cast<double>(properties.sigma_t[i]) * t));
      }))
                                 : 0;
    }
    if (!FromLens::kHeterogeneousLines || !scene_.media->Gathers(*at.scatterer)) return 0;
    const auto its = scene_.media->template CoefficientsAt<Color>(
        *at.scatterer, At(last_), TimeOfMedia<kTraits>(0), {}, properties.form);
    return Mean(its.sigma_t);
  }
  double LogLineOverSample() const {
    const auto& at = std::get<MediumVertex<FromLens>>(path_.places[last_].from_lens);
    const Span span = SpanToLast();
    const double t = Length(At(last_) - span.o), distance_density = DistanceDensity(t);
    if (!(distance_density > 0)) return -kInfinity;
    const LightTable& lights = *scene_.lights;
    const uint32_t light = path_.light.light;
    const LightBounds bounds = lights.BoundsOf(light);
    if (span.extinction > 0 && bounds.kind != LightBounds::Kind::kInfinite &&
        DistanceSamplingSpread(bounds, span.o, span.d, span.begin, span.end, span.extinction) <
            kSpreadGathered) {
      return -kInfinity;
    }
    const auto distances = DistancesTo(bounds, span.o, span.d, span.begin, span.end);
    if (!distances) return -kInfinity;
    return std::log(lights.ChoiceProbability(light, span.chosen_at)) -
           std::log(lights.ChoiceProbability(light, at.point.p, {}, at.guided.lights())) +
           std::log(distances->Pdf(t)) - std::log(distance_density);
  }
  // The density with which the last place samples the light, per solid angle; a probability where
  // the light has no size.
  double LightPdf() const {
    return WithScatterer<FromLens>(path_.places[last_].from_lens, [&](const auto& at) {
      const auto& lights = *scene_.lights;
      const LightEnd& light = path_.light;
      const Vec3f p = at.point.p, w = ToFloat(TowardsLight());
      const LightQuery query(at.guided.lights(), LightSamples());
      if (light.is_medium) return MediaPdf(p, w);
      if (light.is_infinite) {
        return static_cast<double>(
            lights.template PdfEnvironment<kTraits>(p, at.light_hint, w, query));
      }
      if (light.can_be_hit) {
        return static_cast<double>(
            lights.template PdfEmitter<kTraits>(light.light, p, at.light_hint, w, light.p, query));
      }
      return static_cast<double>(
          lights.choice().Probability(light.light, p, at.light_hint, QueryFor<kTraits>(query)));
    });
  }

  // The density with which light samples choose the emission of media, by their grids.
  double MediaPdf([[maybe_unused]] Vec3f p, [[maybe_unused]] Vec3f w) const {
    if constexpr (FromLens::kHeterogeneous) {
      const EmissiveVolumeSampler& grids = scene_.media->emissive_volumes();
      if (!grids.empty()) return static_cast<double>(grids.Pdf(p, w));
    }
    return 0;
  }
  // The most light samples at the last place: half as many at each vertex.
  uint32_t LightSamples() const {
    if (!Has(kTraits, Trait::kLightSplits) || IsMedium(last_)) return 1;
    const double samples = scene_.settings.light_samples * std::pow(0.5, last_);
    return static_cast<uint32_t>(std::max(1.0, std::floor(samples)));
  }

  const StoredPath<kTraits>& path_;
  const CompiledScene& scene_;
  const size_t last_;
};

// -infinity where the technique does not find the path.
template <TraitBits kTraits>
double LogDensityOf(const StoredPath<kTraits>& path, FindsBy technique,
                    const CompiledScene& scene) {
  const PathDensities<kTraits> densities(path, scene);
  if (technique == FindsBy::kHit) return densities.LogHit();
  if (technique == FindsBy::kLine) return densities.LogLine();
  if (technique == FindsBy::kMerge) return densities.LogMerge();
  return technique == FindsBy::kLightPath ? densities.LogLightPath() : densities.LogLightSample();
}

}  // namespace sheaf::render
