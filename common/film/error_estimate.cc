// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error_estimate.h"

#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "common/base/check.h"

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
  constexpr std::array<double, 3> kOfSrgb{0.212639, 0.715169, 0.072192};
  if (chromaticities == Chromaticities()) return kOfSrgb;
  const std::optional<Matrix4> xyz_from_rgb = XyzFromRgb(chromaticities);
  if (!xyz_from_rgb) return kOfSrgb;
  // The blue of ACES2065-1 has negative luminance.
  const auto& y = xyz_from_rgb->m[1];
  return {std::fabs(y[0]), std::fabs(y[1]), std::fabs(y[2])};
}

}  // namespace

FrameError EstimateError(const FramePicture& picture) {
  const std::array<double, 3> luminance = LuminanceWeights(picture.color.chromaticities);
  const std::array<const std::vector<float>*, 3> value{picture.Find("R"), picture.Find("G"),
                                                       picture.Find("B")};
  const std::array<const std::vector<float>*, 3> error{
      picture.Find("stderr.R"), picture.Find("stderr.G"), picture.Find("stderr.B")};
  const std::vector<float>* samples = picture.Find("samples");
  const std::vector<float>* nonfinite = picture.Find("nonfinite");
  SHEAF_CHECK(samples != nullptr && nonfinite != nullptr && value[0] != nullptr &&
              error[0] != nullptr);

  FrameError result;
  double value_sum = 0, sample_sum = 0, nonfinite_sum = 0, pixel_count = 0;
  for (size_t p = 0; p < samples->size(); ++p) {
    nonfinite_sum += (*nonfinite)[p];
    if ((*samples)[p] == 0) continue;
    sample_sum += (*samples)[p];
    pixel_count += 1;
    for (size_t i = 0; i < 3; ++i) value_sum += (*value[i])[p];
  }
  result.sample_count = static_cast<uint64_t>(sample_sum);
  result.nonfinite_count = static_cast<uint64_t>(nonfinite_sum);
  if (pixel_count == 0) return result;

  const double floor = 0.1 * value_sum / (3 * pixel_count);
  double relative_sum = 0, luminance_variance = 0;
  for (size_t p = 0; p < samples->size(); ++p) {
    if ((*samples)[p] == 0) continue;
    double luminance_error = 0;
    for (size_t i = 0; i < 3; ++i) {
      const double e = (*error[i])[p], v = (*value[i])[p];
      luminance_error += luminance[i] * e;
      if (e != 0) relative_sum += e * e / (v * v + floor * floor);
    }
    luminance_variance += luminance_error * luminance_error;
  }
  result.relative_mse = relative_sum / (3 * pixel_count);
  result.standard_error = std::sqrt(luminance_variance) / pixel_count;
  return result;
}

}  // namespace sheaf
