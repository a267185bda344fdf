// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Distances, transmittance and emission where some of a path's media are heterogeneous. Each
// heterogeneous medium, and all homogeneous ones together, sample distances with random numbers of
// their own; the nearest collision is the path's. The other media are then tracked up to it: equal
// numbers give the same events again, and their weights. A merged medium tracks its members in one
// walk (merged_tracking.h). Source: docs/adr/0019, 0310.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <optional>

#include "worker/render/integrator/context.h"
#include "worker/render/medium/merged_tracking.h"

namespace sheaf::render {

// The heterogeneous medium that scatters a path; none if the homogeneous ones do.
using MediumScatterer = std::optional<uint16_t>;

// Calls track(MergedTracking) for the part of the ray up to `length`. part: of a merged medium.
template <typename C, typename Track>
auto TrackMerged(const Context<C>& c, MediumTable::PartId part, const Ray& ray, double length,
                 const PathState<C>& path, MediumForm form, EventStream* stream,
                 TrackingTally* tally, const Track& track) {
  using Color = typename C::Color;
  const MediumTable& media = *c.scene.media;
  const MergedMedium& merged = media.MergedAt(part.medium);
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const double unit = Length(d);
  const auto extinction_of = [&](uint32_t member) {
    const MergedMedium::Member& its = merged.members()[member];
    const auto sigma =
        media.template CoefficientsOf<Color>({its.medium, its.part}, path.wavelengths, form);
    return MemberExtinction<Color>{sigma.sigma_t * static_cast<float>(unit),
                                   !sigma.sigma_s.IsBlack()};
  };
  MergedTracking<Color, decltype(extinction_of)> tracking(merged, o, d, length / unit,
                                                          extinction_of, stream, tally);
  return track(&tracking);
}

// The transmittance of a part of a list, up to `length`.
template <typename C>
typename C::Color PartTransmittance(const Context<C>& c, MediumTable::PartId part, const Ray& ray,
                                    double length, const PathState<C>& path, MediumForm form,
                                    EventStream* stream, TrackingTally* tally) {
  using Color = typename C::Color;
  if (part.part == MediumTable::kMergedPart) {
    return TrackMerged(c, part, ray, length, path, form, stream, tally,
                       [](auto* tracking) { return tracking->Transmittance(); });
  }
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const double unit = Length(d);
  const auto its = c.scene.media->template CoefficientsOf<Color>(part, path.wavelengths, form);
  return c.scene.media->DensityOf(part).Transmittance(
      o, d, length / unit, its.sigma_t * static_cast<float>(unit), stream, tally,
      TimeOfMedia<C::kTraits>(ray.time));
}

// The fraction of the light that collides with a medium that it scatters.
template <typename Color>
Color AlbedoOf(const MediumTable::Coefficients<Color>& its) {
  return MakeColor<Color>([&](size_t component) {
    return its.sigma_t[component] > 0 ? its.sigma_s[component] / its.sigma_t[component] : 0;
  });
}

template <typename Color>
struct PartCollision {
  TrackedCollision<Color> tracked;
  MediumTable::PartId part;  // The one that collides: not merged.
};
// The first collision up to `length`. its: the coefficients of a part that is not merged.
template <typename C>
PartCollision<typename C::Color> TrackPart(const Context<C>& c, MediumTable::PartId part,
                                           const MediumTable::Coefficients<typename C::Color>& its,
                                           const Ray& ray, double length, const PathState<C>& path,
                                           EventStream* stream, TrackingTally* tally) {
  if (part.part == MediumTable::kMergedPart) {
    const auto found =
        TrackMerged(c, part, ray, length, path, path.media.properties.form, stream, tally,
                    [&](auto* tracking) { return tracking->Collision(path.throughput); });
    const MergedMedium::Member& member =
        c.scene.media->MergedAt(part.medium).members()[found.member];
    return {found.tracked, {member.medium, member.part}};
  }
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const double unit = Length(d);
  return {c.scene.media->DensityOf(part).SampleCollision(
              o, d, length / unit, its.sigma_t * static_cast<float>(unit), path.throughput, stream,
              tally, TimeOfMedia<C::kTraits>(ray.time)),
          part};
}

// A distance along the ray, up to `length`. u: the numbers of the medium's slot.
template <typename C>
DistanceSample<typename C::Color> SampleDistanceHeterogeneous(const Context<C>& c, const Ray& ray,
                                                              const std::array<float, 4>& u,
                                                              double length,
                                                              const PathState<C>& path,
                                                              MediumScatterer* scatterer) {
  using Color = typename C::Color;
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const double unit = Length(d);
  const MediumProperties<Color>& properties = path.media.properties;
  const DistanceUniforms homogeneous = MakeDistanceUniforms(u, path.null_crossings);
  DistanceSample<Color> distance_sample =
      SampleDistance<C::kChromaticMedia>(properties, length, homogeneous, path.throughput);
  double end = distance_sample.scatters ? distance_sample.distance : length;
  TrackingTally tally{.bound_factor = c.counts.majorant_factor};
  const auto stream = [&](uint32_t i) {
    return EventStream({std::bit_cast<uint32_t>(u[0]), std::bit_cast<uint32_t>(u[1]),
                        std::bit_cast<uint32_t>(u[2]), (path.null_crossings << 8) | i});
  };
  const MediumTable& media = *c.scene.media;
  const MediumTable::PartList parts = media.PartsOf(path.media.set);
  const auto coefficients = [&](MediumTable::PartId part) {
    return media.template CoefficientsOf<Color>(part, path.wavelengths, properties.form);
  };
  const auto track = [&](uint32_t i, const MediumTable::Coefficients<Color>& its) {
    EventStream events = stream(i);
    return TrackPart(c, parts[i], its, ray, end, path, &events, &tally);
  };
  // Weight of the medium with the first collision and of those after it, up to there.
  Color weight = Color::Gray(1);
  uint32_t nearest = parts.size();
  uint16_t nearest_medium = 0;
  for (uint32_t i = 0; i < parts.size(); ++i) {
    MediumTable::Coefficients<Color> its;
    if (!parts.IsMerged(i)) {
      its = coefficients(parts[i]);
      if (its.sigma_s.IsBlack())
        continue;  // Only absorbs: its weight follows, the end being known.
    }
    const PartCollision<Color> found = track(i, its);
    if (found.tracked.collides) {
      end = found.tracked.t * unit;
      nearest = i;
      nearest_medium = found.part.medium;
      weight = AlbedoOf(parts.IsMerged(i) ? coefficients(found.part) : its);
    }
    weight *= found.tracked.weight;
  }
  if (nearest < parts.size()) {
    distance_sample =
        SampleDistance<C::kChromaticMedia>(properties, end, homogeneous, path.throughput);
    distance_sample.scatters = true;
    distance_sample.distance = end;
    *scatterer = nearest_medium;
  }
  distance_sample.weight *= weight;
  for (uint32_t i = 0; i < parts.size(); ++i) {
    MediumTable::Coefficients<Color> its;
    if (!parts.IsMerged(i)) its = coefficients(parts[i]);
    if (!parts.IsMerged(i) && its.sigma_s.IsBlack()) {
      EventStream events = stream(i);
      distance_sample.weight *= media.DensityOf(parts[i]).Transmittance(
          o, d, end / unit, its.sigma_t * static_cast<float>(unit), &events, &tally,
          TimeOfMedia<C::kTraits>(ray.time));
    } else if (nearest < parts.size() && i < nearest) {
      distance_sample.weight *= track(i, its).tracked.weight;
    }
  }
  c.counts.broken_majorants += tally.violation_count;
  return distance_sample;
}

// Transmittance of the heterogeneous media along the ray, up to `length`, on the crossing-th part
// of a segment.
template <typename C>
typename C::Color TransmittanceHeterogeneous(const Context<C>& c, const Ray& ray,
                                             std::array<float, 2> u, uint32_t crossing,
                                             double length, const PathState<C>& path,
                                             const MediumState<C>& media) {
  using Color = typename C::Color;
  Color transmittance = Color::Gray(1);
  TrackingTally tally{.bound_factor = c.counts.majorant_factor};
  const MediumTable::PartList parts = c.scene.media->PartsOf(media.set);
  for (uint32_t i = 0; i < parts.size() && !transmittance.IsBlack(); ++i) {
    // A key that no distance sample has: the bits of a third number below 1 are never all set.
    EventStream events({std::bit_cast<uint32_t>(u[0]), std::bit_cast<uint32_t>(u[1]), ~uint32_t{0},
                        (crossing << 8) | i});
    transmittance *=
        PartTransmittance(c, parts[i], ray, length, path, media.properties.form, &events, &tally);
  }
  c.counts.broken_majorants += tally.violation_count;
  return transmittance;
}

// The emission of all media along `length` that arrives at the ray's origin.
template <typename C>
typename C::Color EmissionHeterogeneous(const Context<C>& c, const Ray& ray,
                                        const std::array<float, 4>& u, uint32_t crossing,
                                        double length, const PathState<C>& path,
                                        const MediumState<C>& media) {
  using Color = typename C::Color;
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const double unit = Length(d);
  const auto time = TimeOfMedia<C::kTraits>(ray.time);
  const MediumProperties<Color>& properties = media.properties;
  const MediumTable::PartList parts = c.scene.media->PartsOf(media.set);
  const uint32_t count = parts.size();
  TrackingTally tally{.bound_factor = c.counts.majorant_factor};
  // Keys that no distance sample and no shadow ray has. emitter: the emitting medium; count: the
  // homogeneous media.
  const auto stream = [&](uint32_t emitter, uint32_t through) {
    return EventStream({std::bit_cast<uint32_t>(u[0]), std::bit_cast<uint32_t>(u[1]),
                        ~((emitter << 8) + through + 1), crossing});
  };
  // Transmittance from t of the heterogeneous media other than the emitter.
  const auto transmittance_of_others = [&](double t, uint32_t emitter) {
    Color transmittance = Color::Gray(1);
    for (uint32_t j = 0; j < count; ++j) {
      if (j == emitter) continue;
      EventStream events = stream(emitter, j);
      transmittance *=
          PartTransmittance(c, parts[j], ray, t * unit, path, properties.form, &events, &tally);
    }
    return transmittance;
  };
  const auto emission_of_merged = [&](uint32_t i) {
    const MergedMedium& merged = c.scene.media->MergedAt(parts[i].medium);
    const auto source = [&](uint32_t member, double t) {
      const MediumTable::PartId part{merged.members()[member].medium,
                                     merged.members()[member].part};
      const MediumEmission* emission = c.scene.media->MediumEmissionOf(part);
      if (emission == nullptr) return Color();
      const auto its =
          c.scene.media->template CoefficientsOf<Color>(part, path.wavelengths, properties.form);
      const Color emitted = emission->template At<Color>(o + t * d, path.wavelengths) * its.sigma_a;
      if (emitted.IsBlack()) return emitted;
      return emitted * TransmittanceOf<C::kChromaticMedia>(properties, t * unit) *
             transmittance_of_others(t, i);
    };
    EventStream events = stream(i, i);
    return TrackMerged(c, parts[i], ray, length, path, properties.form, &events, &tally,
                       [&](auto* tracking) { return tracking->Emission(source); }) *
           static_cast<float>(unit);
  };
  Color sum;
  for (uint32_t i = 0; i < count; ++i) {
    if (parts.IsMerged(i)) {
      sum += emission_of_merged(i);
      continue;
    }
    const MediumEmission* emission = c.scene.media->MediumEmissionOf(parts[i]);
    if (emission == nullptr) continue;
    const auto its =
        c.scene.media->template CoefficientsOf<Color>(parts[i], path.wavelengths, properties.form);
    EventStream events = stream(i, i);
    const auto source = [&](double t) {
      const Vec3d origin = c.scene.media->DensityOf(parts[i]).OriginOf(o + t * d, time);
      const Color emitted = emission->template At<Color>(origin, path.wavelengths) * its.sigma_a;
      if (emitted.IsBlack()) return emitted;
      return emitted * TransmittanceOf<C::kChromaticMedia>(properties, t * unit) *
             transmittance_of_others(t, i);
    };
    sum += c.scene.media->DensityOf(parts[i]).Emission(o, d, length / unit, source,
                                                       its.sigma_t * static_cast<float>(unit),
                                                       &events, &tally, time) *
           static_cast<float>(unit);
  }
  if (!properties.emission.IsBlack()) {
    // One point for all homogeneous emission.
    EventStream events = stream(count, count);
    const double choice = events.Uniform();
    const EmissionSample point = SampleEmission(properties, length, choice, events.Uniform());
    sum += properties.emission * TransmittanceOf<C::kChromaticMedia>(properties, point.distance) *
           transmittance_of_others(point.distance / unit, count) *
           static_cast<float>(1 / point.pdf);
  }
  c.counts.broken_majorants += tally.violation_count;
  return sum;
}

}  // namespace sheaf::render
