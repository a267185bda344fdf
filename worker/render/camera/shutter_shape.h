// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ShutterShape: how open a shutter is over its time, as straight pieces, and times in proportion to
// that.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/math/vec.h"

namespace sheaf::render {

class ShutterShape {
 public:
  // knots: time (ascending, from 0 to 1 of the shutter's) and how open it is then; none: always
  // fully. Errors: kInvalidArgument for knots that are none.
  static absl::StatusOr<ShutterShape> Make(const std::vector<Vec2f>& knots);
  bool empty() const { return knots_.empty(); }
  // Of u in [0, 1), by inversion: in [0, 1), not descending in u. Requires: not empty.
  float Sample(float u) const;
  // Measure: the shutter's time as a whole is 1.
  double Pdf(double time) const;

 private:
  struct Knot {
    double time, open, before;  // before: the share of all that falls before it.
  };
  std::vector<Knot> knots_;
  double area_ = 0;
};

}  // namespace sheaf::render
