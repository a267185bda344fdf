// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Distance sampling and transmittance in a medium whose extinction is density(x) * sigma_t, with
// one density for all components of a color: where a path collides (delta tracking), and how much
// light is transmitted (residual ratio tracking). Both follow the segments of a MajorantWalk and
// look up the density at tentative collisions, sampled for the component of the largest extinction,
// so that one walk serves all components; the components differ in weight only.
//
// Sources: Woodcock et al. 1965 (delta tracking); Novak, Selle and Jarosz 2014 (residual ratio
// tracking); Kutz et al. 2017, section 4 (one walk for all wavelengths: events are chosen with the
// mean probability, weighted by the throughput of each component, so that the sum of the components
// stays constant and no weight exceeds their number).
//
// Overlapping media: track each with its own stream, take the nearest collision, and track the
// others again, with the same streams, up to it: they sample the same events, and their weights
// there are factors. Transmittances multiply.
//
// A Walk is any type with bool Next(MajorantSegment*). A Density is double(double t), within the
// segment's bounds; a value outside is counted as a violation, and the caller then repeats the
// tracking with raised bounds.
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/math/elementary.h"
#include "worker/render/color/wavelengths.h"
#include "worker/render/medium/majorant_grid.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {

// Violations and cost of tracking.
struct TrackingTally {
  // Input: factor of upper bounds. If it is not 1, lower bounds are taken as 0.
  float bound_factor = 1;
  uint64_t violation_count = 0;  // Densities outside their bounds: the result is biased.
  uint64_t look_up_count = 0;
  uint64_t segment_count = 0;
};

template <typename Color>
struct TrackedCollision {
  bool collides = false;
  double t = 0;  // Position of the collision, if any.
  // Factor of each component of the path's throughput. At a collision it includes the extinction,
  // so the caller applies only the albedo, sigma_s / sigma_t.
  Color weight = Color::Gray(1);
};

namespace internal {

template <typename Walk>
bool NextSegment(Walk* walk, MajorantSegment* segment, TrackingTally* tally) {
  if (!walk->Next(segment)) return false;
  ++tally->segment_count;
  segment->bounds.upper *= tally->bound_factor;
  if (tally->bound_factor != 1) segment->bounds.lower = 0;
  return true;
}

// Tentative collisions: a Poisson process in optical depth that continues across segments.
class TentativeCollisions {
 public:
  explicit TentativeCollisions(EventStream* stream)
      : stream_(stream), depth_(stream->Exponential()) {}

  // Advances *t to the next collision at `rate` per t. Returns false if it lies beyond `end`, and
  // subtracts the optical depth up to there.
  bool Next(double rate, double end, double* t) {
    const double left = rate * (end - *t);
    if (depth_ >= left) {
      depth_ -= left;
      return false;
    }
    *t = std::min(*t + depth_ / rate, end);
    depth_ = stream_->Exponential();
    return true;
  }

 private:
  EventStream* stream_;
  double depth_;
};

inline double RangeOf(DensityBounds bounds) {
  return static_cast<double>(bounds.upper) - static_cast<double>(bounds.lower);
}
// The looked-up density as a fraction of the range of its bounds.
inline double FractionOfRange(double rho, DensityBounds bounds, TrackingTally* tally) {
  ++tally->look_up_count;
  const double lower = bounds.lower;
  if (rho > bounds.upper || rho < lower) ++tally->violation_count;
  return std::min(std::max((rho - lower) / RangeOf(bounds), 0.0), 1.0);
}

// Russian roulette of ratio tracking: below this ratio a walk survives with this probability.
inline constexpr double kRatioRoulette = 0.05, kRatioSurvival = 0.25;

// Transmittance per component over the segments so far.
template <typename Color>
class RatioTracker {
 public:
  RatioTracker(const Color& sigma_t, EventStream* stream, TrackingTally* tally)
      : sigma_max_(MaxComponent(sigma_t)), stream_(stream), tally_(tally), collisions_(stream) {
    for (size_t c = 0; c < kComponents; ++c) {
      ratio_[c] = 1;
      relative_[c] = sigma_max_ > 0 ? sigma_t[c] / sigma_max_ : 0;
    }
  }

  double operator[](size_t c) const { return ratio_[c]; }
  // Multiplies by the transmittance from t0 to t1 of the density above its lower bound. Returns
  // false if Russian roulette ends the walk: the transmittance is 0.
  template <typename Density>
  bool Pass(const Density& density, double t0, double t1, DensityBounds bounds) {
    const double rate = RangeOf(bounds) * sigma_max_;
    if (!(rate > 0)) return true;
    for (double t = t0; collisions_.Next(rate, t1, &t);) {
      const double p = FractionOfRange(density(t), bounds, tally_);
      double largest = 0;
      for (size_t c = 0; c < kComponents; ++c) {
        ratio_[c] *= 1 - p * relative_[c];
        largest = std::max(largest, ratio_[c]);
      }
      if (largest < kRatioRoulette) {
        if (!(stream_->Uniform() < kRatioSurvival) || largest == 0) return false;
        for (double& r : ratio_) r /= kRatioSurvival;
      }
    }
    return true;
  }

 private:
  static constexpr size_t kComponents = kComponentCount<Color>;

  double sigma_max_;
  double ratio_[kComponents], relative_[kComponents];
  EventStream* stream_;
  TrackingTally* tally_;
  TentativeCollisions collisions_;
};

}  // namespace internal

// Samples a collision. sigma_t: extinction per unit of density and of t, nonnegative. throughput:
// of the path, nonnegative; decides the probabilities of events.
template <typename Color, typename Walk, typename Density>
TrackedCollision<Color> TrackCollision(Walk* walk, const Density& density, const Color& sigma_t,
                                       const Color& throughput, EventStream* stream,
                                       TrackingTally* tally) {
  constexpr size_t kComponents = kComponentCount<Color>;
  TrackedCollision<Color> sample;
  const double sigma_max = MaxComponent(sigma_t);
  if (!(sigma_max > 0)) return sample;
  double relative[kComponents];
  for (size_t c = 0; c < kComponents; ++c) relative[c] = sigma_t[c] / sigma_max;
  double weight[kComponents];
  std::fill_n(weight, kComponents, 1.0);
  const auto finish = [&] {
    sample.weight = MakeColor<Color>([&](size_t c) { return static_cast<float>(weight[c]); });
    return sample;
  };
  internal::TentativeCollisions collisions(stream);
  MajorantSegment segment;
  while (internal::NextSegment(walk, &segment, tally)) {
    const double rate = segment.bounds.upper * sigma_max;
    if (!(rate > 0)) continue;
    const DensityBounds bounds{0, segment.bounds.upper};
    const double p_min = segment.bounds.lower / internal::RangeOf(bounds);
    for (double t = segment.t0; collisions.Next(rate, segment.t1, &t);) {
      // The probability of a collision is the mean over components, weighted by throughput.
      double carried = 0, colliding = 0;
      for (size_t c = 0; c < kComponents; ++c) {
        carried += throughput[c] * weight[c];
        colliding += throughput[c] * weight[c] * relative[c];
      }
      const double mean = carried > 0 ? std::min(colliding / carried, 1.0) : 1.0;
      const double u = stream->Uniform();
      // Where the least density would collide, it is not looked up.
      double p = 1;
      if (!(u < p_min * mean)) p = internal::FractionOfRange(density(t), bounds, tally);
      if (u < p * mean) {
        for (size_t c = 0; c < kComponents; ++c) weight[c] *= relative[c] / mean;
        sample.collides = true;
        sample.t = t;
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

// Unbiased estimate of exp(-sigma_t * integral of the density over the walk), per component. Exact,
// without lookups, in cells of constant density, where the bounds are equal.
template <typename Color, typename Walk, typename Density>
Color TrackTransmittance(Walk* walk, const Density& density, const Color& sigma_t,
                         EventStream* stream, TrackingTally* tally) {
  if (!(MaxComponent(sigma_t) > 0)) return Color::Gray(1);
  internal::RatioTracker<Color> ratio(sigma_t, stream, tally);
  double control_depth = 0;  // From the lower bounds: known, not estimated.
  MajorantSegment segment;
  while (internal::NextSegment(walk, &segment, tally)) {
    const double lower = segment.bounds.lower;
    if (lower > 0) control_depth += lower * (segment.t1 - segment.t0);
    if (!ratio.Pass(density, segment.t0, segment.t1, segment.bounds)) return Color::Gray(0);
  }
  return MakeColor<Color>([&](size_t c) {
    return static_cast<float>(ratio[c] * Exp(-static_cast<double>(sigma_t[c]) * control_depth));
  });
}

// Unbiased estimate of the integral over the walk of transmittance * density * source: one uniform
// point in each segment, at any density, and ratio tracking in between. source: Color(double t).
// Source: Simon et al. 2017, "Line Integration for Rendering Heterogeneous Emissive Volumes".
template <typename Color, typename Walk, typename Density, typename Source>
Color TrackEmission(Walk* walk, const Density& density, const Source& source, const Color& sigma_t,
                    EventStream* stream, TrackingTally* tally) {
  internal::RatioTracker<Color> ratio(sigma_t, stream, tally);
  Color sum;
  MajorantSegment segment;
  while (internal::NextSegment(walk, &segment, tally)) {
    const DensityBounds bounds{0, segment.bounds.upper};
    if (!(bounds.upper > 0)) continue;
    const double length = segment.t1 - segment.t0;
    const double point = segment.t0 + stream->Uniform() * length;
    if (!ratio.Pass(density, segment.t0, point, bounds)) return sum;
    const double rho = bounds.upper * internal::FractionOfRange(density(point), bounds, tally);
    if (rho > 0) {
      const Color seen = source(point);
      sum += MakeColor<Color>(
          [&](size_t c) { return static_cast<float>(ratio[c] * rho * length) * seen[c]; });
    }
    if (!ratio.Pass(density, point, segment.t1, bounds)) return sum;
  }
  return sum;
}

}  // namespace sheaf::render
