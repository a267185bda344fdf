// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/http/image/image_difference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/film/shrink_image.h"
#include "coordinator/service/http/image/false_color.h"
#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {
namespace {

constexpr double kDifferenceFloorFraction = 0.1;
// The quantile of the differences at which the colors end, and the ratio of their ends.
constexpr double kDifferenceHighFraction = 0.99;
constexpr double kRangeRatio = 1000;

using ColorPlanes = std::array<const std::vector<float>*, 3>;

ColorPlanes ColorPlanesOf(const FrameImage& image) {
  return {image.Find("R"), image.Find("G"), image.Find("B")};
}

double MeanOfColor(const ColorPlanes& planes) {
  double sum = 0, count = 0;
  for (const std::vector<float>* plane : planes) {
    for (const float value : *plane) {
      if (!std::isfinite(value)) continue;
      sum += std::abs(double{value});
      ++count;
    }
  }
  return count > 0 ? sum / count : 0;
}

// Root of the mean square over the square of a displayed pixel: differences of either sign do not
// cancel. NaN if a value is not finite.
struct SquareShrinking {
  int32_t factor = 1;
  size_t width_px = 0;
  template <class Square>
  float RootMean(int32_t shown_x, int32_t shown_y, const Square& square) const {
    double sum = 0;
    for (int32_t y = shown_y * factor; y < (shown_y + 1) * factor; ++y) {
      const size_t row = static_cast<size_t>(y) * width_px;
      for (int32_t x = shown_x * factor; x < (shown_x + 1) * factor; ++x) {
        sum += square(row + static_cast<size_t>(x));
      }
    }
    return static_cast<float>(std::sqrt(sum / (double{1} * factor * factor)));
  }
};

LayerRange DifferenceRange(const std::vector<float>& values) {
  std::vector<float> known;
  for (const float value : values) {
    if (std::isfinite(value) && value > 0) known.push_back(value);
  }
  if (known.empty()) return {};
  const auto at =
      known.begin() +
      static_cast<std::ptrdiff_t>(kDifferenceHighFraction * static_cast<double>(known.size() - 1));
  std::nth_element(known.begin(), at, known.end());
  return {double{*at} / kRangeRatio, double{*at}};
}

}  // namespace

absl::StatusOr<DisplayImage> MakeDifference(const FrameImage& image, const FrameImage& other,
                                            DifferenceKind kind, const ChosenRange& chosen) {
  if (image.window.Width() != other.window.Width() ||
      image.window.Height() != other.window.Height()) {
    return absl::FailedPreconditionError(
        absl::StrCat("an image of ", image.window.Width(), " by ", image.window.Height(),
                     " pixels and one of ", other.window.Width(), " by ", other.window.Height(),
                     " have no difference; compare them side by side"));
  }
  const ColorPlanes a = ColorPlanesOf(image), b = ColorPlanesOf(other);
  const double floor = kDifferenceFloorFraction * MeanOfColor(b);
  const auto square = [&](size_t i) {
    double sum = 0;
    for (size_t c = 0; c < 3; ++c) {
      const double value = (*b[c])[i];
      double difference = double{(*a[c])[i]} - value;
      const double scale = std::abs(value) + floor;
      if (kind == DifferenceKind::kRelative) difference /= scale > 0 ? scale : 1;
      sum += difference * difference;
    }
    return sum / 3;
  };
  DisplayImage display;
  const SquareShrinking shrink{
      ShrinkFactor(image.window.Width(), image.window.Height(), kPreviewPixelCountMax),
      static_cast<size_t>(image.window.Width())};
  display.width_px = image.window.Width() / shrink.factor;
  display.height_px = image.window.Height() / shrink.factor;
  std::vector<float> values;
  for (int32_t y = 0; y < display.height_px; ++y) {
    for (int32_t x = 0; x < display.width_px; ++x) values.push_back(shrink.RootMean(x, y, square));
  }
  const LayerRange range = chosen ? *chosen : DifferenceRange(values);
  display.range = range;
  for (const float value : values) {
    if (!std::isfinite(value)) {
      display.pixels.push_back(kUnknownColor);
      continue;
    }
    display.pixels.push_back(Viridis(value > 0 ? LogarithmicPlace(range, double{value}) : 0));
  }
  return display;
}

}  // namespace sheaf::coordinator
