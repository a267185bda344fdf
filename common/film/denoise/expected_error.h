// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ExpectedError: the expected squared error of a denoised image, from an estimate of each pixel's
// that is unbiased but noisy.
//
// The error is the sum of a variance V, which the filters' weights and the pixels' variances give
// with little noise, and a squared bias. The estimate less V is an unbiased estimate b of the
// squared bias whose noise, that of the image, may exceed it many times: at 16 samples in images of
// 30,000 pixels even its sum may be useless. Bias is what the tests of means did not see, so it is
// in proportion to the image's variance C and to the weight 1 - w that the pixel gave away: m = C
// (1 - w)^2 times a factor k. The image's k is the estimate sum b / sum m, combined with what is
// expected beforehand, 0.07 +- 0.07, by their variances; around a pixel the same is done again with
// the sums over its neighbors and k m +- k m. Source: Efron and Morris 1973, "Stein's Estimation
// Rule and Its Competitors", for the combination. The number 0.07 was found on synthetic noise and
// on scenes at 16 samples, where the squared bias is 0.03 to 0.18 of m.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace sheaf {

class ExpectedError {
 public:
  ExpectedError(size_t width, size_t height);
  // By R, G, B: V, the estimate and m of a pixel.
  // Thread safety: distinct pixels may be set concurrently.
  void Set(size_t p, const std::array<double, 3>& variance, const std::array<double, 3>& estimate,
           const std::array<double, 3>& scale);
  // Sets k. To be called after Set of all pixels.
  void Sum();
  // The expected mean over pixels and R, G, B of the squared error.
  double Mean() const { return mean_; }
  // The root of the expected squared error of a row's pixels, averaged over those at most `reach`
  // away. Thread safety: after Sum, concurrently for distinct rows.
  void Roots(size_t y, int reach, std::array<std::vector<float>, 3>* roots) const;

 private:
  using Planes3 = std::array<std::vector<float>, 3>;
  const size_t width_, height_;
  Planes3 variance_, bias_, scale_, bias_square_;  // V, b, m and b^2.
  double factor_ = 0, mean_ = 0;
};

}  // namespace sheaf
