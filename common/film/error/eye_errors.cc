// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/eye_errors.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/error/error_planes.h"

namespace sheaf {
namespace {

double Squared(const std::vector<float>& plane, size_t p) {
  return double{plane[p]} * double{plane[p]};
}

}  // namespace

ErrorSums EyeErrors::OfWorse() const {
  ErrorSums worse = left.RelativeMse() >= right.RelativeMse() ? left : right;
  if (worse.pixel_count == 0) return worse;
  const auto pixel_count = left.pixel_count + right.pixel_count;
  const double factor = static_cast<double>(pixel_count) / static_cast<double>(worse.pixel_count);
  worse.pixel_count = pixel_count;
  worse.sum *= factor;
  worse.square_sum *= factor * factor;  // Deviation() divides its root by the number of pixels.
  return worse;
}

EyeErrors EstimateEyeErrors(const FrameImage& image) {
  SHEAF_CHECK(HasEyeDifference(image));
  const PixelRect& window = image.window;
  const int32_t half = window.Width() / 2;
  const std::array<PixelRect, 2> eyes{PixelRect{window.x0, window.y0, window.x0 + half, window.y1},
                                      PixelRect{window.x0 + half, window.y0, window.x1, window.y1}};
  const ErrorPlanes planes(image);
  const double mean = planes.Mean();
  const std::vector<ErrorSums> of_eyes = EstimateTileErrors(image, eyes, mean);
  EyeErrors errors{of_eyes[0], of_eyes[1], {}};
  std::array<const std::vector<float>*, 3> difference;
  for (size_t i = 0; i < 3; ++i) {
    difference[i] = image.Find(absl::StrCat(kEyeDifferenceLayer, ".", std::string(1, "RGB"[i])));
  }
  const std::vector<PixelError> left = PixelErrors(planes, image, eyes[0], mean);
  const std::vector<PixelError> right = PixelErrors(planes, image, eyes[1], mean);
  size_t next = 0;
  for (int32_t y = window.y0; y < window.y1; ++y) {
    for (int32_t x = window.x0; x < window.x0 + half; ++x, ++next) {
      const size_t p = window.IndexOf(x, y), q = p + static_cast<size_t>(half);
      if ((*planes.samples)[p] == 0 || (*planes.samples)[q] == 0) continue;
      double of_difference = 0, of_both = 0;
      for (size_t i = 0; i < 3; ++i) {
        of_difference += Squared(*difference[i], p);
        of_both += Squared(*planes.error[i], p) + Squared(*planes.error[i], q);
      }
      const double error =
          of_both > 0 ? (left[next].value + right[next].value) * of_difference / of_both : 0;
      ++errors.difference.pixel_count;
      errors.difference.sum += error;
      errors.difference.square_sum += error * error;
    }
  }
  return errors;
}

}  // namespace sheaf
