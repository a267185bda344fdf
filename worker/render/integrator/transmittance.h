// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Transmittance along shadow rays, through media and null interfaces; and flights of paths through
// media on grids, which are sampled before surfaces are looked for. Source:
// docs/adr/0410-shadow-rays-in-clouds-by-guesses.md.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include "worker/render/integrator/heterogeneous_transport.h"
#include "worker/render/integrator/medium_boundaries.h"
#include "worker/render/integrator/medium_line.h"
#include "worker/render/integrator/point_in_medium.h"
#include "worker/render/integrator/ray_sight.h"
#include "worker/render/integrator/visibility.h"

namespace sheaf::render {

// Transmittance from the origin of the ray, where the media are `media`, to `end`, or to infinity
// if end is null. media: followed along the ray. u: two numbers of the light's slot.
// on_segment(ray, crossing, length, transmittance, media), if not null, is called at the start of
// each part between surfaces.
template <typename C, typename OnSegment>
typename C::Color TraceTransmittance(const Context<C>& c, Ray ray, const Vec3f* end,
                                     std::array<float, 2> u, const PathState<C>& path,
                                     MediumState<C>&& media, const OnSegment& on_segment) {
  using Color = typename C::Color;
  constexpr bool kHasCallback = !std::is_null_pointer_v<OnSegment>;
  Color transmittance = Color::Gray(1);
  for (uint32_t crossing = 0; crossing < kNullCrossingsMax; ++crossing) {
    ++c.counts.rays;
    ++c.counts.shadow_rays;
    RawHit hit;
    bool hits = false;
    if constexpr (kHasCallback) {
      hits = c.tracer.Intersect(ray, &hit);
    } else if constexpr (C::kNullInterfaces) {
      // Most rays meet no surface that lets them pass, and need no nearest hit. Those that begin in
      // a heterogeneous medium meet its boundary.
      const bool meets_boundary = C::kHeterogeneous && media.properties.is_heterogeneous;
      const Passage passage =
          crossing == 0 && !meets_boundary ? c.tracer.PassageOf(ray) : Passage::kUnknown;
      if (passage == Passage::kBlocked) return {};
      if (passage == Passage::kUnknown) hits = c.tracer.Intersect(ray, &hit);
    } else {
      if (c.tracer.Occluded(ray)) return {};
    }
    const bool is_endless = !hits && end == nullptr;
    double length = std::numeric_limits<double>::infinity();
    if (!is_endless) {
      length = Length(ToDouble(ray.d)) * (hits ? static_cast<double>(hit.t) : 1);
      length = std::max(0.0, length - static_cast<double>(ray.lead));
    }
    if (hits && NeedsExactPlace<C>(media, ray)) length = ExactLength(media.near, ray, length);
    if constexpr (kHasCallback) on_segment(ray, crossing, length, transmittance, media);
    std::optional<SurfacePoint> point;
    bool is_unseen = false;
    if (hits) {
      point = MakeSurfacePoint<C::kTraits>(c.scene.geometry, ray, hit);
      if constexpr (C::kRayKinds) is_unseen = IsUnseen(c, *point, ray.d, kShadowRay, media);
      // From 1 on: the slot's own numbers have been used to choose the light.
      if (!is_unseen && !IsNullInterface(c, *point, MakeNullInterfaceChoice(u, crossing + 1)) &&
          !IsHiddenBoundary(c, *point, ray.d, path, media)) {
        return {};
      }
    }
    if constexpr (C::kNested) {
      if (is_endless && !media.interiors.empty()) {
        ++c.counts.broken_nestings;
        return {};
      }
    }
    if (!media.set.empty()) {
      if (is_endless && media.properties.is_bounded) {
        ++c.counts.broken_nestings;
        return {};
      }
      transmittance *= TransmittanceOf<C::kChromaticMedia>(media.properties, length);
      if constexpr (C::kHeterogeneous) {
        if (media.properties.is_heterogeneous && !transmittance.IsBlack()) {
          transmittance *= TransmittanceHeterogeneous(c, ray, u, crossing, length, path, media);
        }
      }
      if (transmittance.IsBlack()) return {};
    }
    if (!hits) return transmittance;
    if (is_unseen) {
      PassUnseen<C>(*point, &ray, &media);
    } else {
      if (!CrossBoundary(c, *point, ray.d, path, &media)) return {};
      Leave(*point, ray.d, &ray);
    }
    if (end != nullptr) ray.d = *end - ray.o;
  }
  ++c.counts.long_segments;
  return {};
}

// The guess of a transmittance below which Russian roulette decides whether a shadow ray is traced,
// and the least probability that it is: more light may arrive than the guess says.
inline constexpr double kShadowRoulette = 0.1, kShadowSurvivalMin = 0.1;

// The probability with which a shadow ray from p in heterogeneous media is traced. Deep in a cloud
// a few densities tell, before any surface is looked for, that hardly any light arrives.
template <typename C>
double ShadowSurvival([[maybe_unused]] const Context<C>& c, [[maybe_unused]] Vec3f p,
                      [[maybe_unused]] const LightSampleOf<typename C::Color>& light,
                      [[maybe_unused]] const PathState<C>& path) {
  if constexpr (C::kHeterogeneous) {
    if constexpr (C::kKnowsLights) {
      // Statistics of learned lights count the rays that arrive.
      if (c.guiding.fields != nullptr) return 1;
    }
    const MediumState<C>& media = path.media;
    if (!media.properties.is_heterogeneous) return 1;
    constexpr double kRouletteDepth = 2.302585092994046;  // -log(kShadowRoulette)
    const Vec3d o = ToDouble(p), d = ToDouble(light.wi);
    const double t_max = light.is_infinite ? std::numeric_limits<double>::infinity()
                                           : Length(ToDouble(light.p_light) - o);
    const MediumTable::PartList parts = c.scene.media->PartsOf(media.set);
    double depth = 0;
    for (uint32_t i = 0; i < parts.size(); ++i) {
      if (parts.IsMerged(i)) continue;
      const auto its = c.scene.media->template CoefficientsOf<typename C::Color>(
          parts[i], path.wavelengths, media.properties.form);
      double sigma = its.sigma_t[0];
      for (size_t j = 1; j < kComponentCount<typename C::Color>; ++j) {
        sigma = std::min(sigma, double{its.sigma_t[j]});
      }
      if (!(sigma > 0)) continue;
      depth += c.scene.media->DensityOf(parts[i]).GuessDepth(o, d, t_max, sigma);
    }
    if (depth > kRouletteDepth) return std::max(Exp(-depth) / kShadowRoulette, kShadowSurvivalMin);
  }
  return 1;
}

// 0 where Russian roulette decides that no shadow ray is traced from p; otherwise the factor of its
// light. u: two numbers of the light's slot.
template <typename C>
float PlayShadowRoulette(const Context<C>& c, Vec3f p,
                         const LightSampleOf<typename C::Color>& light, std::array<float, 2> u,
                         const PathState<C>& path) {
  const double survival = ShadowSurvival(c, p, light, path);
  if (survival == 1) return 1;
  // A key that no walk has: events of parts have lower numbers.
  EventStream stream(
      {std::bit_cast<uint32_t>(u[0]), std::bit_cast<uint32_t>(u[1]), ~uint32_t{0}, 0xff});
  return stream.Uniform() < survival ? static_cast<float>(1 / survival) : 0;
}

// Transmittance between the point and the light. media: at the point; followed along the ray.
template <typename C>
typename C::Color ShadowTransmittance(const Context<C>& c, const SurfacePoint& point,
                                      const LightSampleOf<typename C::Color>& light,
                                      std::array<float, 2> u, const PathState<C>& path,
                                      MediumState<C>&& media) {
  Vec3f end{};
  Ray ray = ShadowRay(point, light, path.ray.time, &end);
  if constexpr (C::kRayKinds) ray.mask = kShadowRay;
  return TraceTransmittance(c, ray, light.is_infinite ? nullptr : &end, u, path, std::move(media),
                            nullptr);
}

// --- Flights -------------------------------------------------------------------------------------

// How far a path flies through heterogeneous media alone, if no surface comes first.
template <typename C>
struct Flight {
  bool is_known = false;
  DistanceSample<typename C::Color> sample;
  MediumScatterer scatterer;
};

// Nothing where no medium is heterogeneous: paths through fog carry no flight.
template <typename C>
using FlightIf = StateIf<C::kHeterogeneous, Flight<C>>;

// Whether a flight is known to end at a collision.
template <typename C>
bool Scatters(const FlightIf<C>& flight) {
  if constexpr (C::kHeterogeneous) return flight.is_known && flight.sample.scatters;
  return false;
}

// Whether the flight can be known before the ray is traced: nothing else depends on its length.
template <typename C>
bool CanFlyAhead(const Context<C>& c, const PathState<C>& path) {
  const MediumProperties<typename C::Color>& properties = path.media.properties;
  if (!properties.is_heterogeneous || MaxComponent(properties.sigma_t) > 0) return false;
  if (properties.has_emissive_grid || !properties.emission.IsBlack()) return false;
  if (path.ray.contact > 0 || path.ray.t_max < std::numeric_limits<float>::infinity()) return false;
  if constexpr (C::kLines) {
    if (UsesLineSampling<C>(properties)) return false;
  }
  if constexpr (C::kNested) {
    if (!path.media.interiors.empty()) return false;
  }
  if constexpr (C::kRayKinds) {
    if (FarClipOf(c, path) < std::numeric_limits<double>::infinity()) return false;
  }
  return true;
}

// Samples the flight before the path's ray is traced, and lets the ray end a little behind its
// collision. Most flights in a cloud are short, and few surfaces are so near.
template <typename C>
Flight<C> FlyAhead(const Context<C>& c, PathState<C>* path) {
  Flight<C> flight;
  if (!CanFlyAhead(c, *path)) return flight;
  flight.is_known = true;
  flight.sample = SampleDistanceHeterogeneous(
      c, path->ray, c.sampler.Get4(Slot(NextVertexIndex(*path), VertexSlot::kMedium)),
      std::numeric_limits<double>::infinity(), *path, &flight.scatterer);
  if (!flight.sample.scatters) return flight;
  const Vec3f o = Abs(path->ray.o);
  const double reach = static_cast<double>(std::max(o.x, std::max(o.y, o.z)));
  // PointInMedium looks at surfaces up to there.
  const double margin = 2 * kSurfaceNearness * (reach + flight.sample.distance);
  path->ray.t_max = static_cast<float>((flight.sample.distance + margin) /
                                       Length(ToDouble(path->ray.d)));
  return flight;
}

// Whether a flight through all of the media tells what one up to a surface would be: no event has
// changed the path.
template <typename C>
bool IsUneventful(const Flight<C>& flight) {
  return !flight.sample.scatters && flight.sample.weight == C::Color::Gray(1);
}

}  // namespace sheaf::render
