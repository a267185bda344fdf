// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// IntensityMap: relative intensity of a light without size by direction, as a square equal-area map
// of factors, constant over each texel as in pbrt-v4. Space: the map's own.
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

  // d: unit. For NaN returns the factor of an arbitrary texel.
  float At(Vec3f d) const;
  // Number of texels along each side.
  int size() const { return size_; }
  // As given to Make.
  const std::vector<float>& texels() const { return texels_; }
  // Mean over all directions.
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
