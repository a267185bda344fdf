// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EquiangularDistances: distances along a ray by how strongly a light beside it shines there, as
// 1 / (squared distance to the light). Source: Kulla and Fajardo 2012, "Importance Sampling
// Techniques for Path Tracing in Participating Media". A light of some size has at each point the
// distance sqrt(d^2 + r^2), so that a ray through its middle does not favour that without bounds.
//
// Angles are differences of arctangents in one step, and distances come from them without the
// tangent of an angle near a quarter turn: rays that pass a light at any height, and spans of any
// length that lie any distance off, keep their precision. On a ray that leads through a point the
// density is that of 1 / distance^2, as long as the span does not contain the point.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/math/elementary.h"
#include "common/math/vec.h"
#include "worker/render/light/light_bounds.h"

namespace sheaf::render {

class EquiangularDistances {
 public:
  // Of the span [t0, t1] of the ray o + t d; t1 may be infinite. d: unit. light: the place, and
  // radius of a sphere about it, of what shines. None where the span is empty or not finite
  // otherwise, and where it leads through a light without size.
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
  // Per unit of length; 0 outside of the span.
  double Pdf(double t) const {
    const double x = t - closest_;
    if (!(x >= begin_ && x <= end_)) return 0;
    if (angle_ == 0) return (std::isinf(end_) ? begin_ : begin_ / (1 - begin_ / end_)) / (x * x);
    return height_ / (angle_ * (height_ * height_ + x * x));
  }

 private:
  double closest_ = 0;          // Of the ray to the light, as a distance along it.
  double height_ = 0;           // Of the light over the ray.
  double begin_ = 0, end_ = 0;  // Of the span, from the closest point.
  double angle_ = 0;            // That the span takes up, seen from the light. 0: see Make.
};

// On the part of the ray o + t d, t in [begin, end], where the light shines; end may be infinite.
// d: unit. None where it does not shine there, and for lights that stand nowhere. Space: render.
std::optional<EquiangularDistances> DistancesTo(const LightBounds& light, Vec3d o, Vec3d d,
                                                double begin, double end);

// What flights alone make of such light: the mean of its square over the square of its mean, about,
// in a medium of that extinction between begin and end, where paths are scattered and the light is
// sampled. Large where flights are seldom scattered, and where the ray comes near the light.
// Requires: begin < end, and the light has a place.
double SpreadOfFlights(const LightBounds& light, Vec3d o, Vec3d d, double begin, double end,
                       double extinction);
// From this on a line through media that vary gathers light: below, what that takes of the time is
// more than what it takes of the noise (tests/bench/fog_light_bench).
inline constexpr double kSpreadGathered = 2;

}  // namespace sheaf::render
