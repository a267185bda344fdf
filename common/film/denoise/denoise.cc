// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/denoise.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <thread>

#include "common/base/check.h"
#include "common/film/denoise/filter_shares.h"
#include "common/film/denoise/tap_sums.h"

namespace sheaf {
namespace {

// Differences of guides at which the guided filter's weight becomes 0. Depth: relative.
constexpr float kAlbedoTolerance = 0.2F, kNormalTolerance = 0.6F, kAlphaTolerance = 0.5F,
                kDepthTolerance = 0.2F;
// Variances are pooled over pixels at most this far away.
constexpr int kPoolReach = 1;
// The shares of the filters are chosen for the pixels at most this far away, and the displayed
// error is their mean.
constexpr int kShareReach = 8;
// The value against which dark pixels count, relative to the mean (FrameError::relative_mse).
constexpr double kDarkFraction = 0.1;
// Rows that a thread takes at a time.
constexpr size_t kBandRows = 4;

void ForBands(size_t rows, int threads, const std::function<void(size_t, size_t)>& run) {
  const auto work = [&](size_t first_band) {
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

using Planes3 = std::array<std::vector<float>, 3>;

class Denoiser {
 public:
  Denoiser(const FrameImage& image, const ReplicateHalves& halves, int threads);
  DenoisedLight Run();

 private:
  const std::vector<float>& Plane(const char* name) const { return *image_.Find(name); }
  // The share of the weight that half h has in the image.
  float ShareOf(size_t h, size_t p) const {
    return h == 0 ? halves_.even_share()[p] : 1 - halves_.even_share()[p];
  }
  bool IsValid(size_t p) const {
    return halves_.half(0).replicate_count[p] >= 2 && halves_.half(1).replicate_count[p] >= 2;
  }
  void SetGuides(size_t y);
  void PoolVariances(size_t y);
  void Filter(size_t y);
  void FinishPixel(size_t p, const TapSums& sums, size_t lane);
  void SetImportance();

  const FrameImage& image_;
  const ReplicateHalves& halves_;
  const int threads_;
  const size_t width_, height_;
  std::array<const std::vector<float>*, 3> color_;
  FeatureRows features_;
  std::vector<Tap> taps_;
  FilterTerms terms_;
};

Denoiser::Denoiser(const FrameImage& image, const ReplicateHalves& halves, int threads)
    : image_(image),
      halves_(halves),
      threads_(threads),
      width_(static_cast<size_t>(image.window.Width())),
      height_(static_cast<size_t>(image.window.Height())),
      color_{image.Find("R"), image.Find("G"), image.Find("B")},
      features_(width_, height_),
      terms_(width_, height_) {
  // A disc; the weight falls to 0 just beyond its edge.
  constexpr auto kReach = static_cast<int>(kTapReach);
  constexpr double kSquareMax = (kReach + 0.5) * (kReach + 0.5);
  for (int dy = -kReach; dy <= kReach; ++dy) {
    for (int dx = -kReach; dx <= kReach; ++dx) {
      const double square = dx * dx + dy * dy;
      if (square == 0 || square >= kSquareMax) continue;
      const double rest = 1 - square / kSquareMax;
      taps_.push_back(
          {dy * static_cast<ptrdiff_t>(features_.row_stride()) + dx, static_cast<float>(rest)});
    }
  }
}

void Denoiser::SetGuides(size_t y) {
  constexpr std::array<const char*, kGuideCount> kGuides{
      "albedo.R", "albedo.G", "albedo.B", "normal.X", "normal.Y", "normal.Z", "A"};
  constexpr std::array<float, kGuideCount> kTolerances{
      kAlbedoTolerance, kAlbedoTolerance, kAlbedoTolerance, kNormalTolerance,
      kNormalTolerance, kNormalTolerance, kAlphaTolerance};
  const size_t stride = features_.stride();
  float* row = features_.Row(y);
  for (size_t k = 0; k < kGuideCount; ++k) {
    const float* plane = Plane(kGuides[k]).data() + y * width_;
    float* out = row + (kGuidePlane + k) * stride;
    for (size_t x = 0; x < width_; ++x) out[x] = plane[x] / kTolerances[k];
  }
  const float* depth = Plane("depth.Z").data() + y * width_;
  for (size_t x = 0; x < width_; ++x) {
    const double tolerance = double{kDepthTolerance} * double{depth[x]};
    row[kDepthPlane * stride + x] = depth[x];
    row[kDepthScalePlane * stride + x] =
        tolerance > 0 ? static_cast<float>(0.5 / (tolerance * tolerance)) : 0;
  }
}

void Denoiser::PoolVariances(size_t y) {
  const size_t stride = features_.stride();
  float* row = features_.Row(y);
  const auto first = [](size_t i) { return i < kPoolReach ? size_t{0} : i - kPoolReach; };
  for (size_t x = 0; x < width_; ++x) {
    const size_t center = y * width_ + x;
    if (!IsValid(center)) continue;
    row[kValidPlane * stride + x] = 1;
    std::array<double, 6> variance{}, spread{};
    double count = 0;
    for (size_t j = first(y); j <= std::min(y + kPoolReach, height_ - 1); ++j) {
      for (size_t i = first(x); i <= std::min(x + kPoolReach, width_ - 1); ++i) {
        const size_t p = j * width_ + i;
        if (!IsValid(p)) continue;
        ++count;
        for (size_t k = 0; k < 6; ++k) {
          const ReplicateHalves::Half& half = halves_.half(k / 3);
          const double v = double{half.variance[k % 3][p]};
          variance[k] += v;
          spread[k] += v * v / (double{half.replicate_count[p]} - 1);
        }
      }
    }
    for (size_t k = 0; k < 6; ++k) {
      const ReplicateHalves::Half& half = halves_.half(k / 3);
      row[(kMeanPlane + k) * stride + x] = half.mean[k % 3][center];
      row[(kVariancePlane + k) * stride + x] = static_cast<float>(variance[k] / count);
      row[(kSpreadPlane + k) * stride + x] = static_cast<float>(spread[k] / (count * count));
    }
  }
}

void Denoiser::FinishPixel(size_t p, const TapSums& sums, size_t lane) {
  const double a = double{ShareOf(0, p)}, b = double{ShareOf(1, p)};
  const ReplicateHalves::Half &even = halves_.half(0), &odd = halves_.half(1);
  for (size_t f = 0; f < kFilterCount; ++f) {
    // The pixel itself has weight 1, and no difference from itself.
    const double from_even = 1 + double{sums.sums[f][0][3][lane]};
    const double from_odd = 1 + double{sums.sums[f][1][3][lane]};
    for (size_t i = 0; i < 3; ++i) {
      const double e1 = double{sums.sums[f][0][i][lane]} / from_even;
      const double e2 = double{sums.sums[f][1][i][lane]} / from_odd;
      const double even_variance = double{even.variance[i][p]};
      const double odd_variance = double{odd.variance[i][p]};
      const double difference = double{even.mean[i][p]} - double{odd.mean[i][p]};
      const double g = a * b * difference * (e1 - e2) - a * even_variance * (1 - 1 / from_odd) -
                       b * odd_variance * (1 - 1 / from_even);
      terms_.change[f][i][p] = static_cast<float>(b * e1 + a * e2);
      terms_.gain[f][i][p] = static_cast<float>(g);
    }
  }
  for (size_t i = 0; i < 3; ++i) {
    terms_.variance[i][p] = static_cast<float>(a * a * double{even.variance[i][p]} +
                                               b * b * double{odd.variance[i][p]});
  }
}

void Denoiser::Filter(size_t y) {
  const float* row = features_.Row(y);
  for (size_t x = 0; x < width_; x += kBlockSize) {
    const TapSums sums = SumTaps(row + x, features_.stride(), taps_);
    for (size_t lane = 0; lane < std::min(kBlockSize, width_ - x); ++lane) {
      const size_t p = y * width_ + x + lane;
      if (IsValid(p)) {
        FinishPixel(p, sums, lane);
        continue;
      }
      constexpr std::array<const char*, 3> kErrors{"stderr.R", "stderr.G", "stderr.B"};
      for (size_t i = 0; i < 3; ++i) {
        const float error = Plane(kErrors[i])[p];
        terms_.variance[i][p] = error * error;
      }
    }
  }
}

// Pixels count as in FrameError::relative_mse: by their denoised color.
void Denoiser::SetImportance() {
  double sum = 0;
  for (const std::vector<float>* plane : color_) {
    for (const float value : *plane) sum += double{value};
  }
  const double dark = kDarkFraction * sum / static_cast<double>(3 * width_ * height_);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t p = 0; p < width_ * height_; ++p) {
      const double value = double{(*color_[i])[p]} + double{terms_.change[kGuided][i][p]};
      const double square = value * value + dark * dark;
      terms_.importance[i][p] = square > 0 ? static_cast<float>(1 / square) : 0;
    }
  }
}

DenoisedLight Denoiser::Run() {
  const auto for_rows = [&](void (Denoiser::*step)(size_t)) {
    ForBands(height_, threads_, [&](size_t first, size_t end) {
      for (size_t y = first; y < end; ++y) (this->*step)(y);
    });
  };
  for_rows(&Denoiser::SetGuides);
  for_rows(&Denoiser::PoolVariances);
  for_rows(&Denoiser::Filter);
  SetImportance();
  DenoisedLight result;
  for (size_t i = 0; i < 3; ++i) {
    result.color[i] = *color_[i];
    result.error[i].resize(width_ * height_);
  }
  terms_.Multiply();
  ForBands(height_, threads_, [&](size_t first, size_t end) {
    for (size_t y = first; y < end; ++y) terms_.Choose(y, kShareReach, &result.color);
  });
  ForBands(height_, threads_, [&](size_t first, size_t end) {
    for (size_t y = first; y < end; ++y) terms_.AverageErrors(y, kShareReach, &result.error);
  });
  terms_.SumErrors(&result.relative_mse, &result.mse);
  return result;
}

}  // namespace

DenoisedLight Denoise(const FrameImage& image, const ReplicateHalves& halves, int threads) {
  SHEAF_CHECK(threads >= 1 && threads <= kDenoiseThreadsMax);
  SHEAF_CHECK(halves.window() == image.window && !halves.empty());
  return Denoiser(image, halves, threads).Run();
}

}  // namespace sheaf
