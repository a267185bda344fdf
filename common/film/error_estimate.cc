// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error_estimate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "common/base/check.h"
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

// The planes that errors are estimated from.
struct ErrorPlanes {
  explicit ErrorPlanes(const FramePicture& picture)
      : value{picture.Find("R"), picture.Find("G"), picture.Find("B")},
        error{picture.Find("stderr.R"), picture.Find("stderr.G"), picture.Find("stderr.B")},
        samples(picture.Find("samples")),
        nonfinite(picture.Find("nonfinite")) {
    SHEAF_CHECK(samples != nullptr && nonfinite != nullptr && value[0] != nullptr &&
                error[0] != nullptr);
  }
  // The mean of R, G and B over all pixels with samples.
  double Mean() const {
    double sum = 0, count = 0;
    for (size_t p = 0; p < samples->size(); ++p) {
      if ((*samples)[p] == 0) continue;
      for (size_t i = 0; i < 3; ++i) sum += (*value[i])[p];
      count += 3;
    }
    return count == 0 ? 0 : sum / count;
  }

  std::array<const std::vector<float>*, 3> value, error;
  const std::vector<float>* samples;
  const std::vector<float>* nonfinite;
};

// Of pixels with samples: how many, the sums of their values and squares, and of their variances.
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
// `variance`, and the pixels about it.
double PredictTrueSquare(double value, double variance, const LocalSums& about) {
  // What is left of a square after its variance is taken off may not vanish by chance.
  constexpr double kSquareShareMin = 0.25;
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
  return std::max(square - error, kSquareShareMin * square);
}

constexpr int32_t kAboutPx = 2;  // In each direction.

struct PixelError {
  double value = 0;  // Expected: mean over R, G, B of stderr^2 / (truth^2 + floor^2).
  // Of `value`, what one bright hit makes, and the most that it may be instead (RareHits).
  double rare = 0, rare_max = 0;
};

// Of two equal hits among sixteen replicates it is 0.68.
constexpr double kOneHitDeviationMin = 0.8;

// Adds the relative errors of one channel to *errors: of the pixels of `rect`, which is in
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
  // Of each column, the pixels above and below the row, and those with its own.
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

// Of the pixels of `tile`, row-major.
std::vector<PixelError> PixelErrors(const ErrorPlanes& planes, const FramePicture& picture,
                                    const PixelRect& tile, double mean) {
  const PixelRect& window = picture.window;
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

// Pixels in which one replicate alone met something bright, at the rim of a lamp, say, where the
// pixels about are no guide, being lamp and wall. The pixel's share p of it may be any that is
// smaller than seen, and what was seen is of 1 / n of it: the error is 1 / (n p)^2 times the one
// that is told, up to what it is where all that was seen was luck. One hit, and Jeffreys' prior of
// the mean of a Poisson distribution, which has it that small shares are frequent, as at the tails
// of pixel filters, leave for n p the density 2 / sqrt(pi) sqrt(n p) exp(-n p); so
//
//   P(error > x) = kScale (told / x)^kIndex for large x, kIndex = 3 / 4, kScale = 4 / (3 sqrt(pi)).
//
// A sum of such errors is as large as its largest; what is beyond the largest's quantile is left to
// chance, and up to there each has a variance of kIndex kScale / (2 - kIndex) of
// told^kIndex x^(2 - kIndex).
// Source: Jeffreys 1946, "An Invariant Form for the Prior Probability in Estimation Problems".
class RareHits {
 public:
  void Add(size_t tile, const PixelError& error) {
    if (!(error.rare_max > error.rare)) return;
    hits_.push_back({tile, std::pow(error.rare, kIndex), error.rare_max});
    sum_ += hits_.back().told;
  }
  // To the sums of the tiles.
  void AddVariances(std::vector<ErrorSums>* tiles) const {
    // What a first look leaves to chance (coordinator/core/sample_rounds.h).
    constexpr double kBeyondShare = 0.03;
    const double largest = std::pow(kScale * sum_ / kBeyondShare, 1 / kIndex);
    for (const Hit& hit : hits_) {
      const double variance = kIndex * kScale / (2 - kIndex) * hit.told *
                              std::pow(std::min(hit.error_max, largest), 2 - kIndex);
      (*tiles)[hit.tile].square_sum += variance / 2;  // Deviation() doubles it.
    }
  }

 private:
  static constexpr double kIndex = 0.75, kScale = 0.752253;
  struct Hit {
    size_t tile;
    double told;  // To the power of kIndex.
    double error_max;
  };
  std::vector<Hit> hits_;
  double sum_ = 0;  // Of `told`.
};

// rare: where those of the pixels are added to, for the tile of this number.
ErrorSums SumErrors(const ErrorPlanes& planes, const FramePicture& picture, const PixelRect& tile,
                    double mean, size_t tile_number, RareHits* rare) {
  const std::vector<PixelError> errors = PixelErrors(planes, picture, tile, mean);
  const PixelRect& window = picture.window;
  ErrorSums sums;
  size_t next = 0;
  for (int32_t y = tile.y0; y < tile.y1; ++y) {
    for (int32_t x = tile.x0; x < tile.x1; ++x) {
      const PixelError& error = errors[next++];
      const auto p = static_cast<size_t>(y - window.y0) * static_cast<size_t>(window.Width()) +
                     static_cast<size_t>(x - window.x0);
      if ((*planes.samples)[p] == 0) continue;
      ++sums.pixel_count;
      sums.sum += error.value;
      sums.square_sum += error.value * error.value;
      rare->Add(tile_number, error);
    }
  }
  return sums;
}

}  // namespace

double ErrorSums::Deviation() const {
  return pixel_count == 0 ? 0 : std::sqrt(2 * square_sum) / static_cast<double>(pixel_count);
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
