// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error_estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "common/film/error_planes.h"
#include "common/film/mean_interval.h"

namespace sheaf {
namespace {

bool HasSamples(const FilmTile& sums, uint32_t slot, size_t p) {
  for (size_t i = 0; i < kReplicateChannelCount; ++i) {
    if (sums.replicate(slot, i)[p] != 0) return true;
  }
  return false;
}

// color(slot): a replicate's sum of the quantity whose standard error is asked for.
template <typename ColorSum>
double StandardErrorOf(const FilmTile& sums, size_t p, const ColorSum& color) {
  uint32_t replicate_count = 0;
  double sum = 0, weight = 0;
  for (uint32_t slot = 0; slot < sums.replicate_count(); ++slot) {
    if (!HasSamples(sums, slot, p)) continue;
    ++replicate_count;
    sum += color(slot);
    weight += sums.replicate(slot, 3)[p];
  }
  if (replicate_count < 2 || weight == 0) return 0;
  const double mean = sum / weight;
  double squares = 0;
  for (uint32_t slot = 0; slot < sums.replicate_count(); ++slot) {
    if (!HasSamples(sums, slot, p)) continue;
    const double residual = color(slot) - mean * sums.replicate(slot, 3)[p];
    squares += residual * residual;
  }
  return std::sqrt(squares * replicate_count / (replicate_count - 1)) / std::fabs(weight);
}

}  // namespace

double ReplicateStandardError(const FilmTile& sums, size_t component, size_t p) {
  return StandardErrorOf(
      sums, p, [&](uint32_t slot) -> float { return sums.replicate(slot, component)[p]; });
}

double ReplicateStandardError(const FilmTile& sums, const std::array<double, 3>& weights,
                              size_t p) {
  return StandardErrorOf(sums, p, [&](uint32_t slot) {
    double sum = 0;
    for (size_t i = 0; i < 3; ++i) sum += weights[i] * double{sums.replicate(slot, i)[p]};
    return sum;
  });
}

namespace {

// What a standard error of each channel adds to that of luminance, at most.
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

std::vector<ErrorSums> EstimateTileErrors(const FramePicture& picture,
                                          std::span<const PixelRect> tiles) {
  return EstimateTileErrors(picture, tiles, MeanOfPicture(picture));
}

double MeanOfPicture(const FramePicture& picture) { return ErrorPlanes(picture).Mean(); }

std::vector<ErrorSums> EstimateTileErrors(const FramePicture& picture,
                                          std::span<const PixelRect> tiles, double mean) {
  const ErrorPlanes planes(picture);
  std::vector<ErrorSums> sums;
  sums.reserve(tiles.size());
  RareHits rare;
  for (const PixelRect& tile : tiles) {
    sums.push_back(SumErrors(planes, picture, tile, mean, sums.size(), &rare));
  }
  rare.AddVariances(&sums);
  return sums;
}

FrameError EstimateError(const FramePicture& picture) {
  const std::array<double, 3> luminance = LuminanceWeights(picture.color.chromaticities);
  const ErrorPlanes planes(picture);
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
  const ErrorSums sums = EstimateTileErrors(picture, {&picture.window, 1}).front();
  if (sums.pixel_count == 0) return result;
  result.relative_mse = sums.RelativeMse();
  result.relative_mse_deviation = sums.Deviation();
  result.standard_error = std::sqrt(luminance_variance) / static_cast<double>(sums.pixel_count);
  return result;
}

}  // namespace sheaf
