// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, the part in media that are not the same everywhere. Included by path_tracer.h. Each
// of them, and all the others together, are flown through with random numbers of their own; the
// nearest collision is the path's. The others have then been flown through up to there: the same
// numbers give the same events again, and what they weigh. Source: docs/adr/0019.
#pragma once

#include <array>
#include <bit>

#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
Flight<typename PathTracer<kTraits, Tracer, kDirectLight>::Color>
PathTracer<kTraits, Tracer, kDirectLight>::FlyThroughVarying(const Ray& ray,
                                                             const std::array<float, 4>& u,
                                                             uint32_t passes, double length,
                                                             const Path& path,
                                                             Scatterer* scatterer) {
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const double unit = Length(d);
  const MediumMix<Color>& mix = path.media.mix;
  const FlightNumbers even = MakeFlightNumbers(u, passes);
  Flight<Color> flight = SampleFlight<kChromaticMedia>(mix, length, even, path.throughput);
  double end = flight.scatters ? flight.distance : length;
  TrackingTally tally{.bound_factor = counts_.majorant_factor};
  const auto stream = [&](uint32_t i) {
    return EventStream({std::bit_cast<uint32_t>(u[0]), std::bit_cast<uint32_t>(u[1]),
                        std::bit_cast<uint32_t>(u[2]), (passes << 8) | i});
  };
  const auto time = TimeOfMedia<kTraits>(ray.time);
  const MediumTable& media = *scene_.media;
  const MediumTable::PartList parts = media.PartsOf(path.media.set);
  const auto fly = [&](uint32_t i, const MediumTable::Coefficients<Color>& its) {
    EventStream events = stream(i);
    return media.DensityOf(parts[i]).Fly(o, d, end / unit, its.sigma_t * static_cast<float>(unit),
                                         path.throughput, &events, &tally, time);
  };
  // What the part that was met first and those after it weigh, up to there.
  Color weight = Color::Grey(1);
  uint32_t nearest = parts.size();
  for (uint32_t i = 0; i < parts.size(); ++i) {
    const auto its = media.template CoefficientsOf<Color>(parts[i], path.wavelengths, mix.form);
    if (its.sigma_s.IsBlack()) continue;  // Stops nothing: takes what it takes, up to the end.
    const TrackedFlight<Color> tracked = fly(i, its);
    if (tracked.collides) {
      end = tracked.t * unit;
      nearest = i;
      weight = MakeColor<Color>(
          [&](size_t c) { return its.sigma_t[c] > 0 ? its.sigma_s[c] / its.sigma_t[c] : 0; });
    }
    weight *= tracked.weight;
  }
  if (nearest < parts.size()) {
    flight = SampleFlight<kChromaticMedia>(mix, end, even, path.throughput);
    flight.scatters = true;
    flight.distance = end;
    *scatterer = parts[nearest].medium;
  }
  flight.weight *= weight;
  for (uint32_t i = 0; i < parts.size(); ++i) {
    const auto its = media.template CoefficientsOf<Color>(parts[i], path.wavelengths, mix.form);
    if (its.sigma_s.IsBlack()) {
      EventStream events = stream(i);
      flight.weight *= media.DensityOf(parts[i]).Transmittance(
          o, d, end / unit, its.sigma_t * static_cast<float>(unit), &events, &tally, time);
    } else if (nearest < parts.size() && i < nearest) {
      flight.weight *= fly(i, its).weight;
    }
  }
  counts_.broken_majorants += tally.violation_count;
  return flight;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Color
PathTracer<kTraits, Tracer, kDirectLight>::ShareThroughVarying(const Ray& ray,
                                                               std::array<float, 2> u,
                                                               uint32_t pass, double length,
                                                               const Path& path,
                                                               const InMedia& media) {
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const double unit = Length(d);
  const auto time = TimeOfMedia<kTraits>(ray.time);
  Color share = Color::Grey(1);
  TrackingTally tally{.bound_factor = counts_.majorant_factor};
  const MediumTable::PartList parts = scene_.media->PartsOf(media.set);
  for (uint32_t i = 0; i < parts.size() && !share.IsBlack(); ++i) {
    const auto its =
        scene_.media->template CoefficientsOf<Color>(parts[i], path.wavelengths, media.mix.form);
    // A key that no flight has: flights' third number is below 1, and so are its bits.
    EventStream events({std::bit_cast<uint32_t>(u[0]), std::bit_cast<uint32_t>(u[1]), ~uint32_t{0},
                        (pass << 8) | i});
    share *= scene_.media->DensityOf(parts[i]).Transmittance(
        o, d, length / unit, its.sigma_t * static_cast<float>(unit), &events, &tally, time);
  }
  counts_.broken_majorants += tally.violation_count;
  return share;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Color
PathTracer<kTraits, Tracer, kDirectLight>::EmissionAmongVarying(const Ray& ray,
                                                                const std::array<float, 4>& u,
                                                                uint32_t passes, double length,
                                                                const Path& path,
                                                                const InMedia& media) {
  const Vec3d o = ToDouble(ray.o), d = ToDouble(ray.d);
  const double unit = Length(d);
  const auto time = TimeOfMedia<kTraits>(ray.time);
  const MediumMix<Color>& mix = media.mix;
  const MediumTable::PartList parts = scene_.media->PartsOf(media.set);
  const uint32_t count = parts.size();
  TrackingTally tally{.bound_factor = counts_.majorant_factor};
  // Keys that no flight and no shadow ray has. by: what shines; count: the media that do not vary.
  const auto stream = [&](uint32_t by, uint32_t through) {
    return EventStream({std::bit_cast<uint32_t>(u[0]), std::bit_cast<uint32_t>(u[1]),
                        ~((by << 8) + through + 1), passes});
  };
  // What media that vary, but for the by-th, leave of light that comes from t.
  const auto left_by_others = [&](double t, uint32_t by) {
    Color left = Color::Grey(1);
    for (uint32_t j = 0; j < count; ++j) {
      if (j == by) continue;
      const auto its =
          scene_.media->template CoefficientsOf<Color>(parts[j], path.wavelengths, mix.form);
      EventStream events = stream(by, j);
      left *= scene_.media->DensityOf(parts[j]).Transmittance(
          o, d, t, its.sigma_t * static_cast<float>(unit), &events, &tally, time);
    }
    return left;
  };
  Color sum;
  for (uint32_t i = 0; i < count; ++i) {
    const MediumGlow* glow = scene_.media->GlowOf(parts[i]);
    if (glow == nullptr) continue;
    const auto its =
        scene_.media->template CoefficientsOf<Color>(parts[i], path.wavelengths, mix.form);
    EventStream events = stream(i, i);
    const auto source = [&](double t) {
      const Vec3d origin = scene_.media->DensityOf(parts[i]).OriginOf(o + t * d, time);
      const Color shines = glow->template At<Color>(origin, path.wavelengths) * its.sigma_a;
      if (shines.IsBlack()) return shines;
      return shines * TransmittanceOf<kChromaticMedia>(mix, t * unit) * left_by_others(t, i);
    };
    sum += scene_.media->DensityOf(parts[i]).Emission(o, d, length / unit, source,
                                                      its.sigma_t * static_cast<float>(unit),
                                                      &events, &tally, time) *
           static_cast<float>(unit);
  }
  if (!mix.emission.IsBlack()) {
    // One point for all that shines the same everywhere.
    EventStream events = stream(count, count);
    const double choice = events.Uniform();
    const ShiningPoint point = SampleShining(mix, length, choice, events.Uniform());
    sum += mix.emission * TransmittanceOf<kChromaticMedia>(mix, point.distance) *
           left_by_others(point.distance / unit, count) * static_cast<float>(1 / point.pdf);
  }
  counts_.broken_majorants += tally.violation_count;
  return sum;
}

}  // namespace sheaf::render
