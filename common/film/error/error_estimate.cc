// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/error_estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "common/film/error/error_planes.h"
#include "common/film/error/mean_interval.h"

namespace sheaf {

namespace {

// The maximum contribution of each channel's standard error to that of luminance.
std::array<double, 3> LuminanceWeights(const Chromaticities& chromaticities) {
  if (chromaticities == Chromaticities()) return kLuminanceOfSrgb;
  const std::optional<Matrix4> xyz_from_rgb = XyzFromRgb(chromaticities);
  if (!xyz_from_rgb) return kLuminanceOfSrgb;
  // The blue of ACES2065-1 has negative luminance.
  const auto& y = xyz_from_rgb->m[1];
  return {std::fabs(y[0]), std::fabs(y[1]), std::fabs(y[2])};
}

}  // namespace

double ErrorSums::Deviation() const {
  if (pixel_count == 0) return 0;
  const double of_estimate = kEstimateDeviation * sum;
  return std::sqrt(2 * square_sum + of_estimate * of_estimate) / static_cast<double>(pixel_count);
}

std::vector<ErrorSums> EstimateTileErrors(const FrameImage& image,
                                          std::span<const PixelRect> tiles) {
  return EstimateTileErrors(image, tiles, MeanOfImage(image));
}

double MeanOfImage(const FrameImage& image) { return ErrorPlanes(image).Mean(); }

std::vector<ErrorSums> EstimateTileErrors(const FrameImage& image, std::span<const PixelRect> tiles,
                                          double mean) {
  const ErrorPlanes planes(image);
  std::vector<ErrorSums> sums;
  sums.reserve(tiles.size());
  RareHits rare;
  for (const PixelRect& tile : tiles) {
    sums.push_back(SumErrors(planes, image, tile, mean, sums.size(), &rare));
  }
  rare.AddVariances(&sums);
  return sums;
}

FrameError EstimateError(const FrameImage& image) {
  const std::array<double, 3> luminance = LuminanceWeights(image.color.chromaticities);
  const ErrorPlanes planes(image);
  FrameError result;
  double sample_sum = 0, nonfinite_sum = 0, luminance_variance = 0;
  for (size_t p = 0; p < planes.samples->size(); ++p) {
    nonfinite_sum += (*planes.nonfinite)[p];
    sample_sum += (*planes.samples)[p];
    if ((*planes.samples)[p] == 0) continue;
    double luminance_error = 0;
    for (size_t i = 0; i < 3; ++i) luminance_error += luminance[i] * (*planes.error[i])[p];
    luminance_variance += luminance_error * luminance_error;
  }
  result.sample_count = static_cast<uint64_t>(sample_sum);
  result.nonfinite_count = static_cast<uint64_t>(nonfinite_sum);
  const ErrorSums sums = EstimateTileErrors(image, {&image.window, 1}).front();
  if (sums.pixel_count == 0) return result;
  result.relative_mse = sums.RelativeMse();
  result.relative_mse_deviation = sums.Deviation();
  result.standard_error = std::sqrt(luminance_variance) / static_cast<double>(sums.pixel_count);
  return result;
}

}  // namespace sheaf
