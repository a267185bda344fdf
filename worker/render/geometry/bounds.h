// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bounds: an axis-aligned box in double that grows to include points.
#pragma once

#include <algorithm>
#include <limits>

#include "common/math/vec.h"

namespace sheaf::render {

class Bounds {
 public:
  void Add(Vec3d p) {
    for (size_t i = 0; i < 3; ++i) {
      lower_[i] = std::min(lower_[i], p[i]);
      upper_[i] = std::max(upper_[i], p[i]);
    }
  }
  bool empty() const { return !(lower_.x <= upper_.x); }
  Vec3d Center() const { return empty() ? Vec3d{} : lower_ * 0.5 + upper_ * 0.5; }
  Vec3d lower() const { return lower_; }
  Vec3d upper() const { return upper_; }

 private:
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  Vec3d lower_{kInf, kInf, kInf}, upper_{-kInf, -kInf, -kInf};
};

}  // namespace sheaf::render
