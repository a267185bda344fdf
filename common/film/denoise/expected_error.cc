// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/expected_error.h"

#include <algorithm>
#include <cmath>

#include "common/film/denoise/filter_shares.h"

namespace sheaf {
namespace {

// The mean of k before the image is seen; its standard deviation is as large.
constexpr double kFactorBefore = 0.07;

// The mean of two estimates of one number, by the variances of the other one. The second
// estimate's standard deviation is itself.
double Combine(double first, double first_variance, double second) {
  const double variance = second * second;
  const double sum = first_variance + variance;
  return sum > 0 ? (first * variance + second * first_variance) / sum : second;
}

}  // namespace

ExpectedError::ExpectedError(size_t width, size_t height) : width_(width), height_(height) {
  for (Planes3* planes : {&variance_, &bias_, &scale_, &bias_square_}) {
    for (std::vector<float>& plane : *planes) plane.resize(width * height);
  }
}

void ExpectedError::Set(size_t p, const std::array<double, 3>& variance,
                        const std::array<double, 3>& estimate, const std::array<double, 3>& scale) {
  for (size_t i = 0; i < 3; ++i) {
    const double bias = estimate[i] - variance[i];
    variance_[i][p] = static_cast<float>(variance[i]);
    bias_[i][p] = static_cast<float>(bias);
    bias_square_[i][p] = static_cast<float>(bias * bias);
    scale_[i][p] = static_cast<float>(scale[i]);
  }
}

void ExpectedError::Sum() {
  double variance = 0, bias = 0, noise = 0, scale = 0;
  for (size_t p = 0; p < width_ * height_; ++p) {
    double of_pixel = 0;
    for (size_t i = 0; i < 3; ++i) {
      variance += double{variance_[i][p]};
      of_pixel += double{bias_[i][p]};
      scale += double{scale_[i][p]};
    }
    bias += of_pixel;
    noise += of_pixel * of_pixel;
  }
  factor_ = kFactorBefore;
  if (scale > 0) {
    factor_ = std::max(Combine(bias / scale, noise / (scale * scale), kFactorBefore), 0.0);
  }
  mean_ = (variance + factor_ * scale) / static_cast<double>(3 * width_ * height_);
}

void ExpectedError::Roots(size_t y, int reach, Planes3* roots) const {
  const std::vector<double> count =
      SumSquares(std::vector<float>(width_ * height_, 1), width_, height_, y, reach);
  for (size_t i = 0; i < 3; ++i) {
    const auto sums = [&](const Planes3& planes) {
      return SumSquares(planes[i], width_, height_, y, reach);
    };
    const std::vector<double> variance = sums(variance_), bias = sums(bias_),
                              noise = sums(bias_square_), scale = sums(scale_);
    for (size_t x = 0; x < width_; ++x) {
      const double square =
          variance[x] + std::max(Combine(bias[x], noise[x], factor_ * scale[x]), 0.0);
      (*roots)[i][y * width_ + x] = static_cast<float>(std::sqrt(square / count[x]));
    }
  }
}

}  // namespace sheaf
