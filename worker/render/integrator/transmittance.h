// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Transmittance along shadow rays, through media and null interfaces.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <type_traits>
#include <utility>

#include "worker/render/integrator/heterogeneous_transport.h"
#include "worker/render/integrator/medium_boundaries.h"
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
      // Most rays meet no surface that lets them pass, and need no nearest hit.
      const Passage passage = crossing == 0 ? c.tracer.PassageOf(ray) : Passage::kUnknown;
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

}  // namespace sheaf::render
