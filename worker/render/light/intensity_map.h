// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// IntensityMap: how strongly a light without size shines in each direction, as a square equal-area
// map of factors, each constant over its texel as pbrt-v4 has them. Space: the map's own.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/base/vector_bytes.h"
#include "common/math/vec.h"

namespace sheaf::render {

class IntensityMap {
 public:
  // Shape: texels is row-major [size][size]; row 0 is t = 0. Requires: size > 0.
  // Errors: kInvalidArgument naming the first texel that is negative or not finite.
  static absl::StatusOr<IntensityMap> Make(int size, std::vector<float> texels);

  // d: unit; any texel's factor where it is not a number.
  float At(Vec3f d) const;
  // Over all directions.
  double mean() const { return mean_; }
  float peak() const { return peak_; }
  uint64_t memory_bytes() const { return VectorBytes(texels_); }

 private:
  int size_ = 0;
  std::vector<float> texels_;
  double mean_ = 0;
  float peak_ = 0;
};

}  // namespace sheaf::render
