// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EquiangularDistances: samples distances along a ray in proportion to the inverse squared distance
// to a light beside it. Source: Kulla and Fajardo 2012, "Importance Sampling Techniques for Path
// Tracing in Participating Media". A light of radius r has at each point the distance sqrt(d^2 +
// r^2), so that the density stays bounded on a ray through its middle.
//
// Angles are computed as one arctangent of a difference, and distances without the tangent of an
// angle near a quarter turn, so rays that pass a light at any height, and spans of any length at
// any distance, keep their precision. On a ray through a point light the density is that of 1 /
// distance^2, as long as the span does not contain the light.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/math/elementary.h"
#include "common/math/vec.h"
#include "worker/render/light/choice/light_bounds.h"

namespace sheaf::render {

class EquiangularDistances {
 public:
  // Distances in the span [t0, t1] of the ray o + t d; t1 may be infinite. d: unit. light, radius:
  // a bounding sphere of the light. None if the span is empty, if another value is not finite, or
  // if the span contains a light without size.
  static std::optional<EquiangularDistances> Make(Vec3d o, Vec3d d, double t0, double t1,
                                                  Vec3d light, double radius) {
    const Vec3d to_light = light - o;
    EquiangularDistances line;
    line.closest_ = Dot(to_light, d);
    line.height_ = std::sqrt(LengthSquared(Cross(to_light, d)) + radius * radius);
    line.begin_ = t0 - line.closest_;
    line.end_ = t1 - line.closest_;
    if (!(line.end_ > line.begin_) || !std::isfinite(line.begin_)) return std::nullopt;
    const double a = line.begin_, b = line.end_, h = line.height_;
    if (!(h > 0)) {
      if (!(a > 0 || b < 0)) return std::nullopt;
      line.angle_ = 0;
      return line;
    }
    line.angle_ = std::isinf(b) ? Atan2(h, a) : Atan2(h * (b - a), h * h + a * b);
    if (!(line.angle_ > 0)) return std::nullopt;
    return line;
  }

  // u in [0, 1).
  double Sample(double u) const {
    const double a = begin_, b = end_, h = height_;
    double from_closest;
    if (angle_ == 0) {
      from_closest = std::isinf(b) ? a / (1 - u) : a * b / (b - u * (b - a));
    } else {
      const SinCosPair<double> turn = SinCos(u * angle_);
      // h tan(angle of a + turn).
      from_closest = h * (a * turn.cos + h * turn.sin) / (h * turn.cos - a * turn.sin);
    }
    return closest_ + std::clamp(from_closest, a, b);
  }
  // Per unit of length; 0 outside the span.
  double Pdf(double t) const {
    const double x = t - closest_;
    if (!(x >= begin_ && x <= end_)) return 0;
    if (angle_ == 0) return (std::isinf(end_) ? begin_ : begin_ / (1 - begin_ / end_)) / (x * x);
    return height_ / (angle_ * (height_ * height_ + x * x));
  }

 private:
  double closest_ = 0;          // Distance along the ray of its closest point to the light.
  double height_ = 0;           // Height of the light above the ray.
  double begin_ = 0, end_ = 0;  // Ends of the span, relative to the closest point.
  double angle_ = 0;            // The span seen from the light; 0 if the ray passes through it.
};

// Distances for the part of the ray o + t d, t in [begin, end], that the light illuminates; end may
// be infinite. d: unit. None if it illuminates no part, and for infinite lights. Space: render.
std::optional<EquiangularDistances> DistancesTo(const LightBounds& light, Vec3d o, Vec3d d,
                                                double begin, double end);

// Approximate variance of distance sampling for this light, if light is sampled where paths are
// scattered: the mean square of its contribution over the squared mean, in a medium of the given
// extinction between begin and end. Large if scattering is rare, or if the ray passes near the
// light. Requires: begin < end, and the light has a position.
double DistanceSamplingSpread(const LightBounds& light, Vec3d o, Vec3d d, double begin, double end,
                              double extinction);
// A ray through heterogeneous media gathers light if its spread is at least this. Below, gathering
// costs more time than the reduction of noise is worth (tests/bench/fog_light_bench).
inline constexpr double kSpreadGathered = 2;

}  // namespace sheaf::render
