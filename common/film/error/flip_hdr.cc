// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// HDR-FLIP: LDR-FLIP (flip.cc) over exposures.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "common/film/error/flip.h"
#include "common/film/error/mean_interval.h"
#include "common/math/elementary.h"

namespace sheaf {
namespace {

constexpr int32_t kExposuresMax = 64;

size_t PixelCount(const FlipImage& image) {
  return static_cast<size_t>(image.width_px) * static_cast<size_t>(image.height_px);
}

// NaN becomes 0; other values are limited so that they can be squared.
inline double Light(float x) { return x > 0 ? static_cast<double>(std::min(x, 1e30f)) : 0.0; }

// The curve of the paper (2021, sec. 3), a fit to ACES: (k0 x^2 + k1 x) / (k3 x^2 + k4 x + k5).
constexpr double kCurve0 = 0.6 * 0.6 * 2.51, kCurve1 = 0.6 * 0.03, kCurve3 = 0.6 * 0.6 * 2.43,
                 kCurve4 = 0.6 * 0.59, kCurve5 = 0.14;

struct Exposures {
  double start = 0, stop = 0;
  int32_t count = 2;
};
Exposures ExposuresOf(const FlipImage& reference) {
  // A pixel counts as visible if the curve has this value.
  constexpr double kSeen = 0.85;
  const double a = kCurve0 - kCurve3 * kSeen, b = kCurve1 - kCurve4 * kSeen;
  const double half = -0.5 * b / a;
  const double seen = half + std::sqrt(half * half + kCurve5 * kSeen / a);
  std::vector<double> luminance(PixelCount(reference));
  for (size_t p = 0; p < luminance.size(); ++p) {
    for (size_t i = 0; i < 3; ++i) {
      luminance[p] += kLuminanceOfSrgb[i] * Light(reference.rgb[i][p]);
    }
  }
  std::sort(luminance.begin(), luminance.end());
  const size_t last = luminance.size() - 1;
  const double median = 0.5 * (luminance[last / 2] + luminance[last - last / 2]);
  Exposures exposures;
  if (luminance[last] == 0) return exposures;
  exposures.start = Log(seen / luminance[last]) / Log(2.0);
  // If half of the image is black, the darkest luminance above 0.
  const double dim = median > 0 ? median : *std::upper_bound(luminance.begin(), luminance.end(), 0);
  exposures.stop = Log(seen / dim) / Log(2.0);
  exposures.count = std::clamp(static_cast<int32_t>(std::ceil(exposures.stop - exposures.start)), 2,
                               kExposuresMax);
  return exposures;
}

class ExposedImage {
 public:
  ExposedImage(const FlipImage& image, double factor) : source_(image) {
    for (size_t i = 0; i < 3; ++i) {
      planes_[i].resize(PixelCount(image));
      for (size_t p = 0; p < planes_[i].size(); ++p) {
        const double x = factor * Light(image.rgb[i][p]);
        planes_[i][p] = static_cast<float>((kCurve0 * x + kCurve1) * x /
                                           ((kCurve3 * x + kCurve4) * x + kCurve5));
      }
    }
  }
  FlipImage Image() const {
    return {source_.width_px,
            source_.height_px,
            {planes_[0].data(), planes_[1].data(), planes_[2].data()}};
  }

 private:
  const FlipImage& source_;
  std::array<std::vector<float>, 3> planes_;
};

}  // namespace

double MeanHdrFlip(const FlipImage& reference, const FlipImage& image, double pixels_per_degree) {
  const Exposures exposures = ExposuresOf(reference);
  std::vector<float> largest(PixelCount(reference));
  for (int32_t i = 0; i < exposures.count; ++i) {
    const double fraction = static_cast<double>(i) / (exposures.count - 1);
    const double stops = exposures.start + fraction * (exposures.stop - exposures.start);
    const double factor = Pow(2.0, stops);
    const ExposedImage of_reference(reference, factor), of_image(image, factor);
    const std::vector<float> map =
        FlipMap(of_reference.Image(), of_image.Image(), pixels_per_degree);
    for (size_t p = 0; p < map.size(); ++p) largest[p] = std::max(largest[p], map[p]);
  }
  double sum = 0;
  for (const float value : largest) sum += double{value};
  return sum / static_cast<double>(largest.size());
}

}  // namespace sheaf
