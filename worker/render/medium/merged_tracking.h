// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Distance sampling, transmittance and emission in media that overlap: delta tracking and ratio
// tracking as in delta_tracking.h, for all members of a MergedMedium at once. The tentative
// collisions of independent media form one process whose rate is the sum of their rates; each
// belongs to one medium, in proportion to its rate, and looks up the density of that medium alone.
// Source: the superposition theorem of Poisson processes (Kingman 1993, "Poisson Processes").
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "worker/render/medium/delta_tracking.h"
#include "worker/render/medium/merged_medium.h"

namespace sheaf::render {

// For a density of 1, per unit of a ray's t.
template <typename Color>
struct MemberExtinction {
  Color sigma_t;
  bool scatters = false;  // If not, the medium weights paths and never scatters them.
};

template <typename Color>
struct MergedCollision {
  TrackedCollision<Color> tracked;
  uint32_t member = 0;  // That collides.
};

// One walk along a ray. extinction_of(member) returns its MemberExtinction.
template <typename Color, typename ExtinctionOf>
class MergedTracking {
 public:
  MergedTracking(const MergedMedium& merged, Vec3d o, Vec3d d, double t_max,
                 const ExtinctionOf& extinction_of, EventStream* stream, TrackingTally* tally)
      : merged_(merged),
        o_(o),
        d_(d),
        walk_(merged, o, d, t_max),
        extinction_of_(extinction_of),
        stream_(stream),
        tally_(tally) {}

  // See TrackCollision.
  MergedCollision<Color> Collision(const Color& throughput) {
    MergedCollision<Color> found;
    Components weight;
    weight.fill(1);
    const auto collides = [&](const Tentative& event) {
      double carried = 0, colliding = 0;
      const Coefficients& its = *event.its;
      for (size_t c = 0; c < kComponents; ++c) {
        carried += throughput[c] * weight[c];
        colliding += throughput[c] * weight[c] * its.relative[c];
      }
      const double mean = !its.scatters ? 0
                          : carried > 0 ? std::min(colliding / carried, 1.0)
                                        : 1.0;
      if (mean > 0 && stream_->Uniform() < event.p * mean) {
        for (size_t c = 0; c < kComponents; ++c) weight[c] *= its.relative[c] / mean;
        found.tracked.collides = true;
        found.tracked.t = event.t;
        found.member = event.member;
        return true;
      }
      for (size_t c = 0; c < kComponents; ++c) {
        weight[c] *= (1 - event.p * its.relative[c]) / (1 - event.p * mean);
      }
      return false;
    };
    internal::TentativeCollisions collisions(stream_);
    Components control_depth{};
    bool is_done = false;
    while (!is_done && Next()) {
      is_done = Pass(&collisions, segment_.t0, segment_.t1, Range::kOfCollisions, collides);
      AddControl(found.tracked.collides ? found.tracked.t : segment_.t1, Range::kOfCollisions,
                 &control_depth);
    }
    found.tracked.weight = MakeColor<Color>(
        [&](size_t c) { return static_cast<float>(weight[c] * Exp(-control_depth[c])); });
    return found;
  }

  // See TrackTransmittance.
  Color Transmittance() {
    Components control_depth{};
    ratio_.fill(1);
    internal::TentativeCollisions collisions(stream_);
    while (Next()) {
      AddControl(segment_.t1, Range::kFromLower, &control_depth);
      if (PassRatio(&collisions, segment_.t0, segment_.t1, Range::kFromLower)) return {};
    }
    return MakeColor<Color>(
        [&](size_t c) { return static_cast<float>(ratio_[c] * Exp(-control_depth[c])); });
  }

  // See TrackEmission. source(member, t): the emission of a member at a density of 1, as seen from
  // the ray's origin through all but the merged media; black where it does not emit.
  template <typename Source>
  Color Emission(const Source& source) {
    Color sum;
    ratio_.fill(1);
    internal::TentativeCollisions collisions(stream_);
    while (Next()) {
      if (segment_.entries.empty()) continue;
      const double length = segment_.t1 - segment_.t0;
      const double point = segment_.t0 + stream_->Uniform() * length;
      if (PassRatio(&collisions, segment_.t0, point, Range::kFromZero)) return sum;
      for (const MergedMedium::Entry& entry : segment_.entries) {
        const Color seen = source(entry.member, point);
        if (seen.IsBlack()) continue;
        const double rho = DensityOf(entry, point);
        sum += MakeColor<Color>(
            [&](size_t c) { return static_cast<float>(ratio_[c] * rho * length) * seen[c]; });
      }
      if (PassRatio(&collisions, point, segment_.t1, Range::kFromZero)) return sum;
    }
    return sum;
  }

 private:
  static constexpr size_t kComponents = kComponentCount<Color>;
  using Components = std::array<double, kComponents>;
  // The densities that tentative collisions cover: from 0, or from the lower bound, whose effect is
  // known; kOfCollisions: from 0 for media that scatter.
  enum class Range { kFromZero, kFromLower, kOfCollisions };
  struct Coefficients {
    double sigma_max = 0;
    Components relative;
    bool scatters = false;
  };
  struct Tentative {
    double t = 0, p = 0;
    uint32_t member = 0;
    const Coefficients* its = nullptr;
  };

  bool Next() {
    if (!walk_.Next(&segment_)) return false;
    ++tally_->segment_count;
    return true;
  }
  DensityBounds BoundsOf(const MergedMedium::Entry& entry, Range range) {
    const bool is_from_zero = range == Range::kFromZero || tally_->bound_factor != 1 ||
                              (range == Range::kOfCollisions && Of(entry.member).scatters);
    return {is_from_zero ? 0 : entry.bounds.lower, entry.bounds.upper * tally_->bound_factor};
  }
  // Adds the optical depth below the range, from the segment's beginning to t.
  void AddControl(double t, Range range, Components* depth) {
    for (const MergedMedium::Entry& entry : segment_.entries) {
      const double lower = BoundsOf(entry, range).lower;
      // From 0 there is nothing below the range.
      if (!(lower > 0)) continue;
      const Coefficients& its = Of(entry.member);
      for (size_t c = 0; c < kComponents; ++c) {
        (*depth)[c] += its.relative[c] * its.sigma_max * lower * (t - segment_.t0);
      }
    }
  }
  const Coefficients& Of(uint32_t member) {
    std::optional<Coefficients>& its = coefficients_[member];
    if (!its) {
      const MemberExtinction<Color> extinction = extinction_of_(member);
      its.emplace();
      its->sigma_max = MaxComponent(extinction.sigma_t);
      its->scatters = extinction.scatters;
      for (size_t c = 0; c < kComponents; ++c) {
        its->relative[c] = its->sigma_max > 0 ? extinction.sigma_t[c] / its->sigma_max : 0;
      }
    }
    return *its;
  }
  double DensityAt(uint32_t member, double t) const {
    return merged_.members()[member].density->DensityAt(o_ + t * d_);
  }
  double DensityOf(const MergedMedium::Entry& entry, double t) {
    const DensityBounds bounds = BoundsOf(entry, Range::kFromZero);
    return bounds.upper * internal::FractionOfRange(DensityAt(entry.member, t), bounds, tally_);
  }

  // Calls event(Tentative) at each tentative collision from t0 to t1; returns true once that does.
  template <typename Event>
  bool Pass(internal::TentativeCollisions* collisions, double t0, double t1, Range range,
            const Event& event) {
    double rate = 0;
    for (const MergedMedium::Entry& entry : segment_.entries) {
      rate += internal::RangeOf(BoundsOf(entry, range)) * Of(entry.member).sigma_max;
    }
    if (!(rate > 0)) return false;
    for (double t = t0; collisions->Next(rate, t1, &t);) {
      double left = stream_->Uniform() * rate;
      const MergedMedium::Entry* chosen = nullptr;
      for (const MergedMedium::Entry& entry : segment_.entries) {
        const double its = internal::RangeOf(BoundsOf(entry, range)) * Of(entry.member).sigma_max;
        if (!(its > 0)) continue;
        chosen = &entry;
        if (left < its) break;
        left -= its;
      }
      const double p =
          internal::FractionOfRange(DensityAt(chosen->member, t), BoundsOf(*chosen, range), tally_);
      if (event(Tentative{t, p, chosen->member, &Of(chosen->member)})) return true;
    }
    return false;
  }
  // Multiplies ratio_ by the transmittance. True if Russian roulette ends the walk.
  bool PassRatio(internal::TentativeCollisions* collisions, double t0, double t1, Range range) {
    return Pass(collisions, t0, t1, range, [&](const Tentative& event) {
      double largest = 0;
      for (size_t c = 0; c < kComponents; ++c) {
        ratio_[c] *= 1 - event.p * event.its->relative[c];
        largest = std::max(largest, ratio_[c]);
      }
      if (largest >= internal::kRatioRoulette) return false;
      if (!(stream_->Uniform() < internal::kRatioSurvival) || largest == 0) return true;
      for (double& r : ratio_) r /= internal::kRatioSurvival;
      return false;
    });
  }

  const MergedMedium& merged_;
  Vec3d o_, d_;
  MergedMedium::Walk walk_;
  const ExtinctionOf& extinction_of_;
  EventStream* stream_;
  TrackingTally* tally_;
  MergedMedium::Segment segment_;
  Components ratio_{};
  std::array<std::optional<Coefficients>, kMergedMembersMax> coefficients_;
};

}  // namespace sheaf::render
