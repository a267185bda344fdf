// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera/shutter_shape.h"

#include <algorithm>
#include <cmath>

namespace sheaf::render {

absl::StatusOr<ShutterShape> ShutterShape::Make(const std::vector<Vec2f>& knots) {
  ShutterShape shape;
  if (knots.empty()) return shape;
  for (const Vec2f& knot : knots) {
    const double time = static_cast<double>(knot.x), open = static_cast<double>(knot.y);
    double before = 0;
    if (shape.knots_.empty()) {
      if (time != 0) return absl::InvalidArgumentError("the shutter's shape begins at time 0");
    } else {
      const Knot& last = shape.knots_.back();
      if (!(time > last.time)) {
        return absl::InvalidArgumentError("the times of the shutter's shape must ascend");
      }
      before = last.before + 0.5 * (last.open + open) * (time - last.time);
    }
    if (!(open >= 0) || !std::isfinite(before)) {
      return absl::InvalidArgumentError("a shutter is open by at least 0, and finitely");
    }
    shape.knots_.push_back({time, open, before});
  }
  shape.area_ = shape.knots_.back().before;
  if (shape.knots_.back().time != 1 || !(shape.area_ > 0)) {
    return absl::InvalidArgumentError("the shutter's shape ends at time 1 and is open in between");
  }
  for (Knot& knot : shape.knots_) knot.before /= shape.area_;
  return shape;
}

float ShutterShape::Sample(float u) const {
  const double v = static_cast<double>(u);
  size_t i = 0;
  while (i + 2 < knots_.size() && !(v < knots_[i + 1].before)) ++i;
  const Knot &a = knots_[i], &b = knots_[i + 1];
  const double step = b.before - a.before;
  const double w = step > 0 ? std::clamp((v - a.before) / step, 0.0, 1.0) : 0;
  // Inverts the quadratic within a piece, in the form that is stable where the slope vanishes.
  const double root = std::sqrt(a.open * a.open + w * (b.open * b.open - a.open * a.open));
  const double fraction = a.open + root > 0 ? w * (a.open + b.open) / (a.open + root) : 0;
  constexpr float kLast = 0x1.fffffep-1f;  // The largest float below 1.
  return std::min(kLast, static_cast<float>(a.time + std::min(fraction, 1.0) * (b.time - a.time)));
}

double ShutterShape::Pdf(double time) const {
  if (!(time >= 0 && time <= 1)) return 0;
  size_t i = 0;
  while (i + 2 < knots_.size() && !(time < knots_[i + 1].time)) ++i;
  const Knot &a = knots_[i], &b = knots_[i + 1];
  const double t = (time - a.time) / (b.time - a.time);
  return (a.open + t * (b.open - a.open)) / area_;
}

}  // namespace sheaf::render
