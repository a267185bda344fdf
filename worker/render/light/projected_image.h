// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ProjectedImage: the image of a projector without size. It projects along +z an image that is
// upright as seen from the projector (x right, y up); the color is constant over each pixel, as in
// pbrt-v4. Space: the light's own.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/vector_bytes.h"
#include "common/math/vec.h"

namespace sheaf::render {

class ProjectedImage {
 public:
  // fov_degrees: of the image's shorter side. Shape: texels is row-major [height][width], top row
  // first. Requires: width, height > 0; 0 < fov_degrees < 180.
  // Errors: kInvalidArgument naming the first texel that is negative or not finite.
  static absl::StatusOr<ProjectedImage> Make(int width, int height, std::vector<Rgb> texels,
                                             float fov_degrees);

  // Intensity towards d; black outside the image. d need not be unit.
  Rgb At(Vec3f d) const;
  // Index of the texel towards d, row-major, top row first; none outside the image.
  std::optional<size_t> TexelTowards(Vec3f d) const;
  Rgb texel(size_t index) const { return texels_[index]; }
  int width() const { return width_; }
  int height() const { return height_; }
  // Half the image's size at z = 1.
  double half_width() const { return half_width_; }
  double half_height() const { return half_height_; }
  // Maximum of each channel over the image.
  Rgb peak() const { return peak_; }
  // Cosine of the angle between the axis and the image's corners.
  double CosCorner() const;
  // The integral of luminance over all directions.
  double Power() const;
  uint64_t memory_bytes() const { return VectorBytes(texels_); }

 private:
  int width_ = 0, height_ = 0;
  double half_width_ = 0, half_height_ = 0;
  std::vector<Rgb> texels_;
  Rgb peak_;
};

}  // namespace sheaf::render
