// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PhotometricWeb: how strongly a measured luminaire shines in each direction: candelas in planes
// about its axis, linear in both angles between what was measured and dark beyond. Space: that of
// IntensityMap: +z is up, and horizontal angles go from +x by +y.
#pragma once

#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

class PhotometricWeb {
 public:
  // Requires: table as CandelaTable says, with two vertical angles or more.
  explicit PhotometricWeb(const CandelaTable& table);

  // d: unit; 0 where it is not a number.
  float At(Vec3f d) const;
  // Over all directions.
  double mean() const { return mean_; }
  float peak() const { return peak_; }

 private:
  float InPlane(size_t plane, size_t vertical, float t) const;
  double MeanOfPlane(size_t plane) const;

  CandelaTable table_;
  double mean_ = 0;
  float peak_ = 0;
};

}  // namespace sheaf::render
