// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/projected_image.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

// Signed solid angle of the rectangle from the axis to (x, y) at z = 1, with the sign of x y.
double SolidAngleTo(double x, double y) { return Atan2(x * y, std::sqrt(1 + x * x + y * y)); }

}  // namespace

absl::StatusOr<ProjectedImage> ProjectedImage::Make(int width, int height, std::vector<Rgb> texels,
                                                    float fov_degrees) {
  ProjectedImage image;
  image.width_ = width;
  image.height_ = height;
  const double half_side = Tan(static_cast<double>(fov_degrees) * (kPi / 360));
  const double aspect = static_cast<double>(width) / height;
  image.half_width_ = half_side * std::max(aspect, 1.0);
  image.half_height_ = half_side * std::max(1 / aspect, 1.0);
  for (size_t i = 0; i < texels.size(); ++i) {
    const Rgb c = texels[i];
    if (!(c.r >= 0 && c.g >= 0 && c.b >= 0 && IsFinite(c))) {
      const auto row_size = static_cast<size_t>(width);
      return absl::InvalidArgumentError(
          absl::StrCat("texel (", i % row_size, ", ", i / row_size, ") is (", c.r, ", ", c.g, ", ",
                       c.b, "), but light must be finite and not negative"));
    }
    image.peak_ = {std::max(image.peak_.r, c.r), std::max(image.peak_.g, c.g),
                   std::max(image.peak_.b, c.b)};
  }
  image.texels_ = std::move(texels);
  return image;
}

Rgb ProjectedImage::At(Vec3f d) const {
  const std::optional<size_t> texel = TexelTowards(d);
  return texel ? texels_[*texel] : Rgb{};
}

std::optional<size_t> ProjectedImage::TexelTowards(Vec3f d) const {
  if (!(d.z > 0)) return std::nullopt;
  const double z = static_cast<double>(d.z);
  const double u = 0.5 * (1 + static_cast<double>(d.x) / (z * half_width_));
  const double v = 0.5 * (1 - static_cast<double>(d.y) / (z * half_height_));
  if (!(u >= 0 && u < 1 && v >= 0 && v < 1)) return std::nullopt;
  const int x = std::min(static_cast<int>(u * width_), width_ - 1);
  const int y = std::min(static_cast<int>(v * height_), height_ - 1);
  return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
}

double ProjectedImage::CosCorner() const {
  return 1 / std::sqrt(1 + half_width_ * half_width_ + half_height_ * half_height_);
}

// Uses the exact solid angle of each pixel; pbrt-v4 takes the cosine at its center, which agrees
// beyond a few pixels.
double ProjectedImage::Power() const {
  const auto edge = [](int i, int count, double half) { return half * (2.0 * i / count - 1); };
  std::vector<double> above(static_cast<size_t>(width_) + 1);
  for (int x = 0; x <= width_; ++x) {
    above[static_cast<size_t>(x)] = SolidAngleTo(edge(x, width_, half_width_), -half_height_);
  }
  double power = 0;
  for (int y = 0; y < height_; ++y) {
    const double below_y = edge(y + 1, height_, half_height_);
    double left_of_row = 0;
    for (int x = 0; x <= width_; ++x) {
      const auto i = static_cast<size_t>(x);
      const double below = SolidAngleTo(edge(x, width_, half_width_), below_y);
      const double left_of_here = below - above[i];
      above[i] = below;
      if (x > 0) {
        const Rgb c = texels_[static_cast<size_t>(y) * static_cast<size_t>(width_) + i - 1];
        power += static_cast<double>(Luminance(c)) * (left_of_here - left_of_row);
      }
      left_of_row = left_of_here;
    }
  }
  return power;
}

}  // namespace sheaf::render
