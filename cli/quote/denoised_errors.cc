// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/denoised_errors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/film/denoised_output.h"
#include "common/film/error/error_estimate.h"

namespace sheaf::cli {
namespace {

// The fraction of the mean against which dark pixels count, as in FrameError::relative_mse.
constexpr double kDarkShare = 0.1;
// The errors of denoisedError are means over as many pixels in each direction.
constexpr size_t kDenoisedErrorReach = 8;

// The mean over the pixels of a line up to kDenoisedErrorReach away, for `lines` lines of `length`
// values that are `step` apart.
std::vector<double> LineMeans(const std::vector<double>& values, size_t lines, size_t line_step,
                              size_t length, size_t step) {
  std::vector<double> means(values.size());
  for (size_t line = 0; line < lines; ++line) {
    for (size_t i = 0; i < length; ++i) {
      const size_t first = i - std::min(i, kDenoisedErrorReach);
      const size_t end = std::min(length, i + kDenoisedErrorReach + 1);
      double sum = 0;
      for (size_t k = first; k < end; ++k) sum += values[line * line_step + k * step];
      means[line * line_step + i * step] = sum / static_cast<double>(end - first);
    }
  }
  return means;
}

// The squares of a layer's errors, each averaged over the surrounding pixels, as in denoisedError.
std::vector<double> AveragedSquares(const std::vector<float>& errors, const PixelRect& window) {
  std::vector<double> squares(errors.size());
  for (size_t p = 0; p < errors.size(); ++p) squares[p] = double{errors[p]} * double{errors[p]};
  const auto width = static_cast<size_t>(window.Width());
  const auto height = static_cast<size_t>(window.Height());
  return LineMeans(LineMeans(squares, height, width, width, 1), width, 1, height, width);
}

// Sums of squared errors, each relative to the pixel's denoised light: the errors of both layers
// are averaged over the same pixels and have the same weights, so that their ratio tells the gain.
struct RelativeSums {
  double image = 0, denoised = 0;
};

// None are added if the image has no such layers, or no light.
void AddCrop(const FrameImage& crop, RelativeSums* sums) {
  std::array<const std::vector<float>*, 3> light{}, error{}, image_error{};
  double total = 0;
  for (size_t i = 0; i < 3; ++i) {
    const std::string component = absl::StrCat(".", std::string(1, "RGB"[i]));
    light[i] = crop.Find(kDenoisedLayer + component);
    error[i] = crop.Find(kDenoisedErrorLayer + component);
    image_error[i] = crop.Find("stderr" + component);
    if (light[i] == nullptr || error[i] == nullptr || image_error[i] == nullptr) return;
    for (const float value : *light[i]) total += double{value};
  }
  const size_t count = light[0]->size();
  const double dark = kDarkShare * total / static_cast<double>(3 * count);
  if (!(dark > 0)) return;
  for (size_t i = 0; i < 3; ++i) {
    const std::vector<double> squares = AveragedSquares(*image_error[i], crop.window);
    for (size_t p = 0; p < count; ++p) {
      const double value = double{(*light[i])[p]}, denoised = double{(*error[i])[p]};
      const double weight = 1 / (value * value + dark * dark);
      sums->image += squares[p] * weight;
      sums->denoised += denoised * denoised * weight;
    }
  }
}

}  // namespace

std::vector<PixelRect> DenoisedCrops(const PixelRect& window) {
  const int32_t width = window.Width(), height = window.Height(), across = kDenoisedCropsPerAxis;
  const double pixels = kDenoisedCropShare * static_cast<double>(window.PixelCount());
  const int32_t edge = std::min({static_cast<int32_t>(std::sqrt(pixels / (across * across))),
                                 kDenoisedCropPxMax, width / across, height / across});
  std::vector<PixelRect> crops;
  if (edge < kDenoisedCropPxMin) return crops;
  const int32_t gap_x = (width - across * edge) / (across + 1);
  const int32_t gap_y = (height - across * edge) / (across + 1);
  for (int32_t row = 0; row < across; ++row) {
    for (int32_t column = 0; column < across; ++column) {
      const int32_t x0 = window.x0 + gap_x + column * (edge + gap_x);
      const int32_t y0 = window.y0 + gap_y + row * (edge + gap_y);
      crops.push_back({x0, y0, x0 + edge, y0 + edge});
    }
  }
  return crops;
}

DenoisedPilot DenoisedErrors(std::span<const FrameImage> crops) {
  RelativeSums sums;
  double error = 0;
  int count = 0;
  for (const FrameImage& crop : crops) {
    const double before = sums.image;
    AddCrop(crop, &sums);
    if (!(sums.image > before)) continue;
    error += EstimateError(crop).relative_mse;
    ++count;
  }
  if (count == 0) return {};
  return {error / count, error / count * sums.denoised / sums.image};
}

coordinator::Estimate ImageErrorFor(double target, const DenoisedPilot& pilot) {
  const double most = target * pilot.Gain();
  if (!(pilot.denoised > 0) || pilot.Gain() == 1) return {most, target, most};
  const double likely = pilot.image * std::pow(target / pilot.denoised, 1 / kDenoisedRate);
  return {std::clamp(likely, target, most), target, most};
}

}  // namespace sheaf::cli
