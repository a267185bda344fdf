// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/block_filter.h"

#include <cstdlib>

#include "common/base/check.h"

namespace sheaf {
namespace {

static_assert(kPatchReach == 1);  // SetPatchSums and SetWeights add three rows and columns.
// Bounds a pixel's t^2, so that none is infinite.
constexpr float kSquareMax = 1000;
// The patch's mean t^2 from which the weight falls, and up to which.
constexpr float kAlike = 1, kDifferent = 2;
// The relative difference of depths at which the guided filter's weight becomes 0.
constexpr float kDepthTolerance = 0.3F;
constexpr float kTiny = 1e-30F;
constexpr size_t kDepthGuide = kGuideCount - 1;

// Indices of BlockFilter's sums.
constexpr size_t kWeightSum = 0, kChangeSum = kFilterCount, kVarianceSum = kChangeSum + 6;

// b where a is no number.
float Min(float a, float b) { return a < b ? a : b; }
float Max(float a, float b) { return a > b ? a : b; }

}  // namespace

BlockFilter::BlockFilter(const PixelFeatures& features) : features_(features) {
  // A disc; the spatial weight falls to 0 just beyond its edge.
  constexpr auto kReach = static_cast<ptrdiff_t>(kTapReach);
  constexpr double kSquaredReach = (kReach + 0.5) * (kReach + 0.5);
  for (ptrdiff_t dy = -kReach; dy <= kReach; ++dy) {
    for (ptrdiff_t dx = -kReach; dx <= kReach; ++dx) {
      const auto square = static_cast<double>(dx * dx + dy * dy);
      if (square == 0 || square >= kSquaredReach) continue;
      taps_.push_back({dx, dy, static_cast<float>(1 - square / kSquaredReach)});
    }
  }
}

void BlockFilter::Run(size_t x0, size_t y0, size_t x1, size_t y1) {
  SHEAF_CHECK(x1 - x0 <= kBlockWidth && y1 - y0 <= kBlockRows);
  x0_ = x0;
  y0_ = y0;
  width_ = x1 - x0;
  rows_ = y1 - y0;
  for (size_t half = 0; half < 2; ++half) {
    for (size_t sum = 0; sum < kSumCount; ++sum) sums_[half][sum].fill(0);
    // The pixel itself has weight 1 and no difference.
    for (size_t f = 0; f < kFilterCount; ++f) sums_[half][kWeightSum + f].fill(1);
    for (size_t row = 0; row < rows_; ++row) {
      for (size_t i = 0; i < 3; ++i) {
        const float* variance =
            features_.Row(1 - half, PixelFeatures::kVariance + i, y0_ + row) + x0_;
        for (size_t pair = 0; pair < kFilterPairCount; ++pair) {
          float* sum = sums_[half][kVarianceSum + pair * 3 + i].data() + row * kBlockWidth;
          for (size_t x = 0; x < width_; ++x) sum[x] = variance[x];
        }
      }
    }
    for (const Tap& tap : taps_) AddTap(half, tap);
  }
}

// row: of the patches' rows, which begin one above the block.
void BlockFilter::SetPatchSums(size_t half, const Tap& tap, size_t row) {
  const ptrdiff_t to_neighbor = tap.dy * static_cast<ptrdiff_t>(features_.stride()) + tap.dx;
  // The pixel left of the block.
  const auto at = [&](const float* block_row) {
    return block_row + x0_ - 1 + static_cast<ptrdiff_t>(row * features_.stride()) -
           static_cast<ptrdiff_t>(features_.stride());
  };
  std::array<float, kBlockWidth + 2> squares{}, counts{};
  const float* valid = at(features_.ValidRow(y0_));
  const size_t width = width_ + 2;
  for (size_t i = 0; i < 3; ++i) {
    const float* mean = at(features_.Row(half, PixelFeatures::kMean + i, y0_));
    const float* pooled = at(features_.Row(half, PixelFeatures::kPooled + i, y0_));
    const float* mean_q = mean + to_neighbor;
    const float* pooled_q = pooled + to_neighbor;
    for (size_t x = 0; x < width; ++x) {
      const float difference = mean_q[x] - mean[x];
      squares[x] += difference * difference / (pooled[x] + pooled_q[x] + kTiny);
    }
  }
  const float* valid_q = valid + to_neighbor;
  for (size_t x = 0; x < width; ++x) {
    counts[x] = valid[x] * valid_q[x];
    squares[x] = Min(squares[x] * (1.0F / 3), kSquareMax) * counts[x];
  }
  for (size_t x = 0; x < width_; ++x) {
    squares_[row][x] = squares[x] + squares[x + 1] + squares[x + 2];
    counts_[row][x] = counts[x] + counts[x + 1] + counts[x + 2];
  }
}

void BlockFilter::SetWeights(size_t half, const Tap& tap, size_t row, float* unguided,
                             float* guided) const {
  const ptrdiff_t to_neighbor = tap.dy * static_cast<ptrdiff_t>(features_.stride()) + tap.dx;
  const size_t y = y0_ + row;
  const float* valid = features_.ValidRow(y) + x0_;
  const float* valid_q = valid + to_neighbor;
  const float* variance = features_.Row(half, PixelFeatures::kSum, y) + x0_;
  const float* variance_q = variance + to_neighbor;
  for (size_t x = 0; x < width_; ++x) {
    const float square = squares_[row][x] + squares_[row + 1][x] + squares_[row + 2][x];
    const float count = counts_[row][x] + counts_[row + 1][x] + counts_[row + 2][x];
    const float mean = square / Max(count, 1);
    const float alike = Max(Min((kDifferent - mean) * (1 / (kDifferent - kAlike)), 1), 0);
    const float ratio = variance[x] / (variance_q[x] + kTiny);
    unguided[x] = tap.weight * valid[x] * valid_q[x] * alike * Min(ratio, 1);
  }
  std::array<float, kBlockWidth> distance{};
  for (size_t k = 0; k < kDepthGuide; ++k) {
    const float* guide = features_.Row(half, PixelFeatures::kGuide + k, y) + x0_;
    const float* guide_q = guide + to_neighbor;
    for (size_t x = 0; x < width_; ++x) {
      const float difference = guide_q[x] - guide[x];
      distance[x] += difference * difference;
    }
  }
  const float* depth = features_.Row(half, PixelFeatures::kGuide + kDepthGuide, y) + x0_;
  const float* depth_q = depth + to_neighbor;
  constexpr float kScale = 2 / (kDepthTolerance * kDepthTolerance);
  for (size_t x = 0; x < width_; ++x) {
    const float difference = depth_q[x] - depth[x];
    const float sum = depth[x] * depth[x] + depth_q[x] * depth_q[x];
    const float rest = Max(1 - distance[x] - kScale * difference * difference / (sum + kTiny), 0);
    guided[x] = unguided[x] * rest * rest;
  }
}

void BlockFilter::AddTap(size_t half, const Tap& tap) {
  for (size_t row = 0; row < rows_ + 2 * kPatchReach; ++row) SetPatchSums(half, tap, row);
  const ptrdiff_t to_neighbor = tap.dy * static_cast<ptrdiff_t>(features_.stride()) + tap.dx;
  std::array<std::array<float, kBlockWidth>, kFilterCount> weights{};
  for (size_t row = 0; row < rows_; ++row) {
    SetWeights(half, tap, row, weights[kUnguided].data(), weights[kGuided].data());
    const auto sum = [&](size_t index) { return sums_[half][index].data() + row * kBlockWidth; };
    for (size_t f = 0; f < kFilterCount; ++f) {
      float* const total = sum(kWeightSum + f);
      for (size_t x = 0; x < width_; ++x) total[x] += weights[f][x];
    }
    for (size_t i = 0; i < 3; ++i) {
      const float* mean = features_.Row(1 - half, PixelFeatures::kMean + i, y0_ + row) + x0_;
      const float* mean_q = mean + to_neighbor;
      const float* variance_q =
          features_.Row(1 - half, PixelFeatures::kVariance + i, y0_ + row) + x0_ + to_neighbor;
      float* const change_u = sum(kChangeSum + i);
      float* const change_g = sum(kChangeSum + 3 + i);
      float* const uu = sum(kVarianceSum + i);
      float* const ug = sum(kVarianceSum + 3 + i);
      float* const gg = sum(kVarianceSum + 6 + i);
      for (size_t x = 0; x < width_; ++x) {
        const float u = weights[kUnguided][x], g = weights[kGuided][x];
        const float difference = mean_q[x] - mean[x];
        change_u[x] += u * difference;
        change_g[x] += g * difference;
        const float by_u = u * variance_q[x], by_g = g * variance_q[x];
        uu[x] += u * by_u;
        ug[x] += u * by_g;
        gg[x] += g * by_g;
      }
    }
  }
}

TapSums BlockFilter::At(size_t half, size_t x, size_t y) const {
  const size_t p = (y - y0_) * kBlockWidth + x - x0_;
  TapSums sums;
  for (size_t f = 0; f < kFilterCount; ++f) {
    sums.weight[f] = sums_[half][kWeightSum + f][p];
    for (size_t i = 0; i < 3; ++i) sums.change[f][i] = sums_[half][kChangeSum + f * 3 + i][p];
  }
  for (size_t pair = 0; pair < kFilterPairCount; ++pair) {
    for (size_t i = 0; i < 3; ++i) {
      sums.variance[pair][i] = sums_[half][kVarianceSum + pair * 3 + i][p];
    }
  }
  return sums;
}

}  // namespace sheaf
