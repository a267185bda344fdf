// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Free flight through a medium whose extinction is density(x) * sigma_t, one density for all
// components of a colour: where a path collides (delta tracking) and how much light passes
// (residual ratio tracking). Both follow the segments of a MajorantWalk and look the density up at
// tentative collisions, drawn for the component of the largest extinction, so that one walk serves
// all components; what differs between them is a weight.
//
// Sources: Woodcock et al. 1965 (delta tracking); Novak, Selle and Jarosz 2014 (residual ratio
// tracking); Kutz et al. 2017, section 4 (one walk for all wavelengths: events are chosen with the
// mean probability, weighted by what each component carries, so that the sum of the components
// never changes and no weight exceeds their number).
//
// Media that overlap: track each with a stream of its own, take the nearest collision, and track
// the others again, with the same streams, up to it: they meet the same events, and their weights
// there are factors. Transmittances multiply.
//
// A walk is anything with bool Next(MajorantSegment*). A density is double(double t), at most the
// segment's upper and at least its lower bound; where it is not, the violation is counted.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/math/elementary.h"
#include "worker/render/event_stream.h"
#include "worker/render/majorant_grid.h"
#include "worker/render/wavelengths.h"

namespace sheaf::render {

// What tracking met that it must not meet, and what it cost.
struct TrackingTally {
  uint64_t violation_count = 0;  // Densities beyond their bounds: the result is biased.
  uint64_t look_up_count = 0;
  uint64_t segment_count = 0;
};

template <typename Color>
struct TrackedFlight {
  bool collides = false;
  double t = 0;  // Where, if it collides.
  // What each component of the path's throughput is multiplied by. At a collision the extinction is
  // in it: what is left to apply is the albedo, sigma_s / sigma_t.
  Color weight = Color::Grey(1);
};

// sigma_t: extinction per unit of density and of t, no component negative. throughput: what the
// path carries, no component negative; it decides which event serves it best.
template <typename Color, typename Walk, typename Density>
TrackedFlight<Color> TrackFlight(Walk* walk, const Density& density, const Color& sigma_t,
                                 const Color& throughput, EventStream* stream,
                                 TrackingTally* tally) {
  constexpr size_t kComponents = kComponentCount<Color>;
  TrackedFlight<Color> flight;
  const double sigma_max = MaxComponent(sigma_t);
  if (!(sigma_max > 0)) return flight;
  double relative[kComponents];
  for (size_t c = 0; c < kComponents; ++c) relative[c] = sigma_t[c] / sigma_max;
  double weight[kComponents];
  std::fill_n(weight, kComponents, 1.0);
  const auto finish = [&] {
    flight.weight = MakeColor<Color>([&](size_t c) { return static_cast<float>(weight[c]); });
    return flight;
  };
  double depth = stream->Exponential();
  MajorantSegment segment;
  while (walk->Next(&segment)) {
    ++tally->segment_count;
    const double upper = segment.bounds.upper, rate = upper * sigma_max;
    if (!(rate > 0)) continue;
    for (double t = segment.t0;;) {
      const double left = rate * (segment.t1 - t);
      if (depth >= left) {
        depth -= left;
        break;
      }
      t = std::min(t + depth / rate, segment.t1);
      depth = stream->Exponential();
      ++tally->look_up_count;
      const double rho = density(t);
      if (rho > upper) ++tally->violation_count;
      const double p = std::min(std::max(rho / upper, 0.0), 1.0);
      // The probability of a collision: the mean over components by what they carry.
      double carried = 0, colliding = 0;
      for (size_t c = 0; c < kComponents; ++c) {
        carried += throughput[c] * weight[c];
        colliding += throughput[c] * weight[c] * relative[c];
      }
      const double mean = carried > 0 ? std::min(colliding / carried, 1.0) : 1.0;
      if (stream->Uniform() < p * mean) {
        for (size_t c = 0; c < kComponents; ++c) weight[c] *= relative[c] / mean;
        flight.collides = true;
        flight.t = t;
        return finish();
      }
      // Here p * mean < 1.
      for (size_t c = 0; c < kComponents; ++c) {
        weight[c] *= (1 - p * relative[c]) / (1 - p * mean);
      }
    }
  }
  return finish();
}

// Below this the walk of a transmittance ends by chance, at this chance to go on.
inline constexpr double kTransmittanceRoulette = 0.05, kRouletteSurvival = 0.25;

// An unbiased estimate of exp(-sigma_t * integral of the density over the walk), per component.
// Exact, without a look-up, where bounds meet: in cells of one density.
template <typename Color, typename Walk, typename Density>
Color TrackTransmittance(Walk* walk, const Density& density, const Color& sigma_t,
                         EventStream* stream, TrackingTally* tally) {
  constexpr size_t kComponents = kComponentCount<Color>;
  const double sigma_max = MaxComponent(sigma_t);
  if (!(sigma_max > 0)) return Color::Grey(1);
  double ratio[kComponents], relative[kComponents];
  for (size_t c = 0; c < kComponents; ++c) {
    ratio[c] = 1;
    relative[c] = sigma_t[c] / sigma_max;
  }
  double control_depth = 0;  // Of the lower bounds: known, not estimated.
  double depth = stream->Exponential();
  MajorantSegment segment;
  while (walk->Next(&segment)) {
    ++tally->segment_count;
    const double lower = segment.bounds.lower, range = segment.bounds.upper - lower;
    if (lower > 0) control_depth += lower * (segment.t1 - segment.t0);
    const double rate = range * sigma_max;
    if (!(rate > 0)) continue;
    for (double t = segment.t0;;) {
      const double left = rate * (segment.t1 - t);
      if (depth >= left) {
        depth -= left;
        break;
      }
      t = std::min(t + depth / rate, segment.t1);
      depth = stream->Exponential();
      ++tally->look_up_count;
      const double rho = density(t);
      if (rho > segment.bounds.upper || rho < lower) ++tally->violation_count;
      const double p = std::min(std::max((rho - lower) / range, 0.0), 1.0);
      double largest = 0;
      for (size_t c = 0; c < kComponents; ++c) {
        ratio[c] *= 1 - p * relative[c];
        largest = std::max(largest, ratio[c]);
      }
      if (largest < kTransmittanceRoulette) {
        if (!(stream->Uniform() < kRouletteSurvival) || largest == 0) return Color::Grey(0);
        for (double& r : ratio) r /= kRouletteSurvival;
      }
    }
  }
  return MakeColor<Color>([&](size_t c) {
    return static_cast<float>(ratio[c] * Exp(-static_cast<double>(sigma_t[c]) * control_depth));
  });
}

// An unbiased estimate of the integral over the walk of transmittance * density * source: one point
// of each segment, evenly drawn, however thin what shines is, and ratio tracking in between.
// source: Color(double t). Source: Simon et al. 2017, "Line Integration for Rendering Heterogeneous
// Emissive Volumes".
template <typename Color, typename Walk, typename Density, typename Source>
Color TrackEmission(Walk* walk, const Density& density, const Source& source, const Color& sigma_t,
                    EventStream* stream, TrackingTally* tally) {
  constexpr size_t kComponents = kComponentCount<Color>;
  const double sigma_max = MaxComponent(sigma_t);
  double ratio[kComponents], relative[kComponents];
  for (size_t c = 0; c < kComponents; ++c) {
    ratio[c] = 1;
    relative[c] = sigma_max > 0 ? sigma_t[c] / sigma_max : 0;
  }
  Color sum;
  double depth = stream->Exponential();
  MajorantSegment segment;
  while (walk->Next(&segment)) {
    ++tally->segment_count;
    const double upper = segment.bounds.upper, rate = upper * sigma_max;
    if (!(upper > 0)) continue;
    const double length = segment.t1 - segment.t0;
    const double point = segment.t0 + stream->Uniform() * length;
    bool is_behind_point = false;
    for (double t = segment.t0;;) {
      const double next = t + depth / rate;  // Infinite, or NaN, where nothing is taken.
      if (!is_behind_point && !(next < point)) {
        is_behind_point = true;
        ++tally->look_up_count;
        const double rho = density(point);
        if (rho > upper) ++tally->violation_count;
        if (rho > 0) {
          const Color seen = source(point);
          sum += MakeColor<Color>(
              [&](size_t c) { return static_cast<float>(ratio[c] * rho * length) * seen[c]; });
        }
      }
      if (!(next < segment.t1)) {
        depth -= rate * (segment.t1 - t);
        break;
      }
      t = next;
      depth = stream->Exponential();
      ++tally->look_up_count;
      const double rho = density(t);
      if (rho > upper) ++tally->violation_count;
      const double p = std::min(std::max(rho / upper, 0.0), 1.0);
      double largest = 0;
      for (size_t c = 0; c < kComponents; ++c) {
        ratio[c] *= 1 - p * relative[c];
        largest = std::max(largest, ratio[c]);
      }
      if (largest < kTransmittanceRoulette) {
        if (!(stream->Uniform() < kRouletteSurvival) || largest == 0) return sum;
        for (double& r : ratio) r /= kRouletteSurvival;
      }
    }
  }
  return sum;
}

}  // namespace sheaf::render
