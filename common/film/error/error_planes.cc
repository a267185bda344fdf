// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/error_planes.h"

#include <algorithm>
#include <cmath>

#include "common/base/check.h"

namespace sheaf {
namespace {

// Over pixels with samples: their number, the sums of their values and squares, and of their
// variances.
struct LocalSums {
  double count = 0, value = 0, square = 0, variance = 0;
  void Add(const LocalSums& other) {
    count += other.count;
    value += other.value;
    square += other.square;
    variance += other.variance;
  }
};

// The square of a pixel's true value, predicted from its mean `value`, whose variance is
// `variance`, and the pixels around it.
double PredictTrueSquare(double value, double variance, const LocalSums& about) {
  // At least this fraction of the square remains after its variance is subtracted.
  constexpr double kSquareFractionMin = 0.25;
  double weight = 0, mean = 0, noise = 0;
  if (about.count > 0 && variance > 0) {
    mean = about.value / about.count;
    noise = about.variance / about.count;
    const double spread = about.square / about.count - mean * mean;
    const double of_truth = std::max(0.0, spread - noise * (1 - 1 / about.count));
    weight = variance / (variance + of_truth);
  }
  const double truth = weight * mean + (1 - weight) * value;
  const double error =
      weight * weight * noise / std::max(about.count, 1.0) + (1 - weight) * (1 - weight) * variance;
  const double square = truth * truth;
  return std::max(square - error, kSquareFractionMin * square);
}

constexpr int32_t kAboutPx = 2;  // Radius in each direction.

// Adds to *errors the relative errors in one channel of the pixels of `rect`, which is in
// coordinates of the planes, row-major.
void AddChannelErrors(const ErrorPlanes& planes, size_t channel, const PixelRect& rect,
                      int32_t width, int32_t height, double floor_square,
                      std::vector<PixelError>* errors) {
  const float* values = planes.value[channel]->data();
  const float* deviations = planes.error[channel]->data();
  const auto index = [&](int32_t x, int32_t y) {
    return static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
  };
  const auto pixel = [&](int32_t x, int32_t y) -> LocalSums {
    const size_t p = index(x, y);
    if ((*planes.samples)[p] == 0) return {};
    const double v = values[p], s = deviations[p];
    return {1, v, v * v, s * s};
  };
  const int32_t x_begin = std::max(rect.x0 - kAboutPx, 0);
  const int32_t x_end = std::min(rect.x1 + kAboutPx, width);
  // Per column, the sums over the pixels above and below the row, and over those and its own.
  std::vector<LocalSums> others(static_cast<size_t>(x_end - x_begin)), all(others.size());
  size_t out = 0;
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    for (int32_t x = x_begin; x < x_end; ++x) {
      LocalSums sums;
      for (int32_t v = std::max(y - kAboutPx, 0); v < std::min(y + kAboutPx + 1, height); ++v) {
        if (v != y) sums.Add(pixel(x, v));
      }
      const auto column = static_cast<size_t>(x - x_begin);
      others[column] = all[column] = sums;
      all[column].Add(pixel(x, y));
    }
    for (int32_t x = rect.x0; x < rect.x1; ++x, ++out) {
      const LocalSums own = pixel(x, y);
      if (own.count == 0 || own.variance == 0) continue;
      LocalSums about = others[static_cast<size_t>(x - x_begin)];
      for (int32_t u = std::max(x - kAboutPx, 0); u < std::min(x + kAboutPx + 1, width); ++u) {
        if (u != x) about.Add(all[static_cast<size_t>(u - x_begin)]);
      }
      const double square = PredictTrueSquare(own.value, own.variance, about);
      PixelError& error = (*errors)[out];
      const double expected = own.variance / (square + floor_square) / 3;
      error.value += expected;
      const double deviation = std::sqrt(own.variance), size = std::fabs(own.value);
      if (deviation < kOneHitDeviationMin * size) continue;
      const double rest = std::max(size - deviation, 0.0);
      error.rare += expected;
      error.rare_max += own.variance / (rest * rest + floor_square) / 3;
    }
  }
}

}  // namespace

ErrorPlanes::ErrorPlanes(const FrameImage& image)
    : value{image.Find("R"), image.Find("G"), image.Find("B")},
      error{image.Find("stderr.R"), image.Find("stderr.G"), image.Find("stderr.B")},
      samples(image.Find("samples")),
      nonfinite(image.Find("nonfinite")) {
  SHEAF_CHECK(samples != nullptr && nonfinite != nullptr && value[0] != nullptr &&
              error[0] != nullptr);
}

double ErrorPlanes::Mean() const {
  double sum = 0, count = 0;
  for (size_t p = 0; p < samples->size(); ++p) {
    if ((*samples)[p] == 0) continue;
    for (size_t i = 0; i < 3; ++i) sum += (*value[i])[p];
    count += 3;
  }
  return count == 0 ? 0 : sum / count;
}

std::vector<PixelError> PixelErrors(const ErrorPlanes& planes, const FrameImage& image,
                                    const PixelRect& tile, double mean) {
  const PixelRect& window = image.window;
  const PixelRect rect{tile.x0 - window.x0, tile.y0 - window.y0, tile.x1 - window.x0,
                       tile.y1 - window.y0};
  SHEAF_CHECK(rect.x0 >= 0 && rect.y0 >= 0 && tile.x1 <= window.x1 && tile.y1 <= window.y1);
  std::vector<PixelError> errors(static_cast<size_t>(rect.PixelCount()));
  const double floor = 0.1 * mean;
  for (size_t channel = 0; channel < 3; ++channel) {
    AddChannelErrors(planes, channel, rect, window.Width(), window.Height(), floor * floor,
                     &errors);
  }
  return errors;
}

void RareHits::Add(size_t tile, const PixelError& error, double count) {
  if (!(error.rare_max > error.rare)) return;
  hits_.push_back({tile, count * std::pow(error.rare, kIndex), error.rare_max});
  sum_ += hits_.back().told;
}

void RareHits::AddVariances(std::vector<ErrorSums>* tiles) const {
  // The error probability of the first check (coordinator/core/frame/sample_rounds.h).
  constexpr double kBeyondFraction = 0.03;
  const double largest = std::pow(kScale * sum_ / kBeyondFraction, 1 / kIndex);
  for (const Hit& hit : hits_) {
    const double variance = kIndex * kScale / (2 - kIndex) * hit.told *
                            std::pow(std::min(hit.error_max, largest), 2 - kIndex);
    (*tiles)[hit.tile].square_sum += variance / 2;  // Deviation() doubles it.
  }
}

ErrorSums SumErrors(const ErrorPlanes& planes, const FrameImage& image, const PixelRect& tile,
                    double mean, size_t tile_number, RareHits* rare) {
  const std::vector<PixelError> errors = PixelErrors(planes, image, tile, mean);
  ErrorSums sums;
  size_t next = 0;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    for (int32_t x = tile.x0; x < tile.x1; ++x) {
      const PixelError& error = errors[next++];
      if ((*planes.samples)[image.window.IndexOf(x, y)] == 0) continue;
      ++sums.pixel_count;
      sums.sum += error.value;
      sums.square_sum += error.value * error.value;
      rare->Add(tile_number, error);
    }
  }
  return sums;
}

}  // namespace sheaf
