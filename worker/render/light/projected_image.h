// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ProjectedImage: a slide in a projector without size. It shines along +z through a picture that
// stands upright when looked at from the projector (x right, y up); each pixel's colour is constant
// over it, as in pbrt-v4. Space: the light's own.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "common/base/vector_bytes.h"
#include "common/math/vec.h"

namespace sheaf::render {

class ProjectedImage {
 public:
  // fov_degrees: of the picture's shorter side. Shape: texels is row-major [height][width], top row
  // first. Requires: width, height > 0; 0 < fov_degrees < 180.
  // Errors: kInvalidArgument naming the first texel that is negative or not finite.
  static absl::StatusOr<ProjectedImage> Make(int width, int height, std::vector<Rgb> texels,
                                             float fov_degrees);

  // Intensity towards d; black outside of the picture. d need not be unit.
  Rgb At(Vec3f d) const;
  // Of each channel, over the picture.
  Rgb peak() const { return peak_; }
  // Of the angle between the axis and the picture's corners.
  double CosCorner() const;
  // The integral of luminance over all directions.
  double Power() const;
  uint64_t memory_bytes() const { return VectorBytes(texels_); }

 private:
  int width_ = 0, height_ = 0;
  double half_width_ = 0, half_height_ = 0;  // Of the picture, where z = 1.
  std::vector<Rgb> texels_;
  Rgb peak_;
};

}  // namespace sheaf::render
