// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShutterShape: the opening of a shutter over time, piecewise linear, and times sampled in
// proportion to it.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"

namespace sheaf::render {

class ShutterShape {
 public:
  // knots: time (ascending, 0 to 1 over the shutter interval) and opening at that time; empty:
  // always fully open. Errors: kInvalidArgument for invalid knots.
  static absl::StatusOr<ShutterShape> Make(const std::vector<Vec2f>& knots);
  bool empty() const { return knots_.empty(); }
  // u in [0, 1), by inversion: in [0, 1), nondecreasing in u. Requires: not empty.
  float Sample(float u) const;
  // Measure: the whole shutter interval is 1.
  double Pdf(double time) const;

 private:
  struct Knot {
    double time, open, before;  // before: fraction of the area before this knot.
  };
  std::vector<Knot> knots_;
  double area_ = 0;
};

}  // namespace sheaf::render
