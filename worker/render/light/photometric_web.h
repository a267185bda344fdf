// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PhotometricWeb: the intensity of a measured luminaire by direction: candelas in planes about its
// axis, linear in both angles between measurements and zero beyond. Space: that of IntensityMap: +z
// is up, and horizontal angles turn from +x to +y.
#pragma once

#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

class PhotometricWeb {
 public:
  // Requires: table is valid as CandelaTable defines, with at least two vertical angles.
  explicit PhotometricWeb(const CandelaTable& table);

  // d: unit. Returns 0 for NaN.
  float At(Vec3f d) const;
  const CandelaTable& table() const { return table_; }
  // Mean over all directions.
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
