// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/denoise.h"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <thread>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/check.h"
#include "common/film/denoise/block_filter.h"
#include "common/film/denoise/expected_error.h"
#include "common/film/denoise/filter_shares.h"
#include "common/film/denoise/pixel_features.h"

namespace sheaf {
namespace {

// The shares of the filters are chosen for the pixels at most this far away, and the displayed
// error is their mean.
constexpr int kShareReach = 8;
// The value against which dark pixels count, relative to the mean (FrameError::relative_mse).
constexpr double kDarkFraction = 0.1;
// Rows that a thread takes at a time.
constexpr size_t kBandRows = kBlockRows;
// Deviations below this fraction of the mean are taken for rounding.
constexpr double kFloorFraction = 1e-4;

// Runs bands of rows on threads; each thread has a state of its own, which `start` makes.
template <typename Start>
void ForBands(size_t rows, int threads, const Start& start) {
  const auto work = [&](size_t first_band) {
    auto run = start();
    for (size_t y = first_band * kBandRows; y < rows;
         y += static_cast<size_t>(threads) * kBandRows) {
      run(y, std::min(y + kBandRows, rows));
    }
  };
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back(work, static_cast<size_t>(i));
  work(0);
  for (std::thread& thread : others) thread.join();
}

double MeanLight(const FrameImage& image) {
  double sum = 0;
  size_t count = 0;
  for (const char* channel : {"R", "G", "B"}) {
    for (const float value : *image.Find(channel)) sum += double{value};
    count += image.Find(channel)->size();
  }
  return sum / static_cast<double>(count);
}

class Denoiser {
 public:
  Denoiser(const FrameImage& image, const ReplicateHalves& halves, int threads);
  DenoisedLight Run();

 private:
  bool IsValid(size_t p) const {
    return halves_.half(0).replicate_count[p] >= 2 && halves_.half(1).replicate_count[p] >= 2;
  }
  FilteredPixel PixelFrom(size_t p, const std::array<TapSums, 2>& sums) const;
  void SetImportance(size_t p, FilteredPixel* pixel) const;
  void FilterRows(size_t first, size_t end, BlockFilter* filter);
  void ChooseRow(size_t y, DenoisedLight* result);

  const FrameImage& image_;
  const ReplicateHalves& halves_;
  const int threads_;
  const size_t width_, height_;
  const std::array<const std::vector<float>*, 3> color_, deviation_;
  const double mean_;  // The mean of the image's light.
  std::vector<FilteredPixel> pixels_;
  ShareChoice choice_;
  ExpectedError error_;
};

Denoiser::Denoiser(const FrameImage& image, const ReplicateHalves& halves, int threads)
    : image_(image),
      halves_(halves),
      threads_(threads),
      width_(static_cast<size_t>(image.window.Width())),
      height_(static_cast<size_t>(image.window.Height())),
      color_{image.Find("R"), image.Find("G"), image.Find("B")},
      deviation_{image.Find("stderr.R"), image.Find("stderr.G"), image.Find("stderr.B")},
      mean_(MeanLight(image)),
      pixels_(width_ * height_),
      choice_(width_, height_),
      error_(width_, height_) {}

FilteredPixel Denoiser::PixelFrom(size_t p, const std::array<TapSums, 2>& sums) const {
  const double a = double{halves_.even_share()[p]}, b = 1 - a;
  const ReplicateHalves::Half &even = halves_.half(0), &odd = halves_.half(1);
  FilteredPixel pixel;
  for (size_t f = 0; f < kFilterCount; ++f) {
    const double from_even = double{sums[0].weight[f]}, from_odd = double{sums[1].weight[f]};
    pixel.own_weight[f] = static_cast<float>(b / from_even + a / from_odd);
    for (size_t i = 0; i < 3; ++i) {
      const double e1 = double{sums[0].change[f][i]} / from_even;
      const double e2 = double{sums[1].change[f][i]} / from_odd;
      const double even_variance = double{even.variance[i][p]};
      const double odd_variance = double{odd.variance[i][p]};
      const double difference = double{even.mean[i][p]} - double{odd.mean[i][p]};
      const double gain = a * b * difference * (e1 - e2) - a * even_variance * (1 - 1 / from_odd) -
                          b * odd_variance * (1 - 1 / from_even);
      pixel.change[f][i] = static_cast<float>(b * e1 + a * e2);
      pixel.gain[f][i] = static_cast<float>(gain);
      pixel.covariance[f][i] =
          static_cast<float>(a * a * even_variance / from_odd + b * b * odd_variance / from_even);
    }
  }
  for (size_t pair = 0; pair < kFilterPairCount; ++pair) {
    const size_t first = pair == 2 ? kGuided : kUnguided, second = pair == 0 ? kUnguided : kGuided;
    const double from_even = double{sums[0].weight[first]} * double{sums[0].weight[second]};
    const double from_odd = double{sums[1].weight[first]} * double{sums[1].weight[second]};
    for (size_t i = 0; i < 3; ++i) {
      pixel.variance[pair][i] =
          static_cast<float>(b * b * double{sums[0].variance[pair][i]} / from_even +
                             a * a * double{sums[1].variance[pair][i]} / from_odd);
    }
  }
  for (size_t i = 0; i < 3; ++i) {
    pixel.image_variance[i] = static_cast<float>(a * a * double{even.variance[i][p]} +
                                                 b * b * double{odd.variance[i][p]});
  }
  SetImportance(p, &pixel);
  return pixel;
}

// Pixels count as in FrameError::relative_mse: by their denoised color.
void Denoiser::SetImportance(size_t p, FilteredPixel* pixel) const {
  const double dark = kDarkFraction * mean_;
  for (size_t i = 0; i < 3; ++i) {
    double square = 0;
    for (size_t f = 0; f < kFilterCount; ++f) {
      const double value = double{(*color_[i])[p]} + double{pixel->change[f][i]};
      square = std::max(square, value * value);
    }
    square += dark * dark;
    pixel->importance[i] = square > 0 ? static_cast<float>(1 / square) : 0;
  }
}

void Denoiser::FilterRows(size_t first, size_t end, BlockFilter* filter) {
  for (size_t x0 = 0; x0 < width_; x0 += kBlockWidth) {
    const size_t x1 = std::min(x0 + kBlockWidth, width_);
    filter->Run(x0, first, x1, end);
    for (size_t y = first; y < end; ++y) {
      for (size_t x = x0; x < x1; ++x) {
        const size_t p = y * width_ + x;
        if (IsValid(p)) {
          pixels_[p] = PixelFrom(p, {filter->At(0, x, y), filter->At(1, x, y)});
        } else {
          for (size_t i = 0; i < 3; ++i) {
            const float deviation = (*deviation_[i])[p];
            pixels_[p].image_variance[i] = deviation * deviation;
          }
        }
        choice_.Set(p, pixels_[p]);
      }
    }
  }
}

void Denoiser::ChooseRow(size_t y, DenoisedLight* result) {
  const std::vector<Shares> shares = choice_.Choose(y, kShareReach);
  for (size_t x = 0; x < width_; ++x) {
    const size_t p = y * width_ + x;
    const FilteredPixel& pixel = pixels_[p];
    // A pixel that is not valid has no changes, and keeps its variance.
    const Shares of = IsValid(p) ? shares[x] : Shares();
    const double given = 1 - pixel.OwnWeightAt(of);
    std::array<double, 3> variance{}, estimate{}, scale{};
    for (size_t i = 0; i < 3; ++i) {
      const double image_variance = double{pixel.image_variance[i]};
      result->color[i][p] = static_cast<float>(double{(*color_[i])[p]} + pixel.ChangeAt(of, i));
      variance[i] = pixel.VarianceAt(of, i);
      estimate[i] = image_variance + pixel.QuadraticOf(i).At(of);
      scale[i] = image_variance * given * given;
    }
    error_.Set(p, variance, estimate, scale);
  }
}

DenoisedLight Denoiser::Run() {
  DenoisedLight result;
  for (size_t i = 0; i < 3; ++i) {
    result.color[i].resize(width_ * height_);
    result.error[i].resize(width_ * height_);
  }
  {
    const double floor = kFloorFraction * mean_;
    const PixelFeatures features(halves_, floor * floor);
    ForBands(height_, threads_, [&] {
      return [this, filter = std::make_unique<BlockFilter>(features)](size_t first, size_t end) {
        FilterRows(first, end, filter.get());
      };
    });
  }
  ForBands(height_, threads_, [&] {
    return [&](size_t first, size_t end) {
      for (size_t y = first; y < end; ++y) ChooseRow(y, &result);
    };
  });
  error_.Sum();
  result.mse = error_.Mean();
  ForBands(height_, threads_, [&] {
    return [&](size_t first, size_t end) {
      for (size_t y = first; y < end; ++y) error_.Roots(y, kShareReach, &result.error);
    };
  });
  return result;
}

}  // namespace

DenoisedLight Denoise(const FrameImage& image, const ReplicateHalves& halves, int threads) {
  SHEAF_CHECK(threads >= 1 && threads <= kDenoiseThreadsMax);
  SHEAF_CHECK(halves.window() == image.window && !halves.empty());
  return Denoiser(image, halves, threads).Run();
}

void SetDenoised(DenoisedLight light, FrameImage* image) {
  constexpr std::array<const char*, 3> kComponents{".R", ".G", ".B"};
  for (size_t i = 0; i < 3; ++i) {
    *image->Find(absl::StrCat(kDenoisedLayer, kComponents[i])) = std::move(light.color[i]);
    *image->Find(absl::StrCat(kDenoisedErrorLayer, kComponents[i])) = std::move(light.error[i]);
  }
}

}  // namespace sheaf
