// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FilterTerms: the estimate of the denoised image's error as a quadratic function of the filters'
// shares (denoise.h), and the choice of the shares.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/film/denoise/tap_sums.h"

namespace sheaf {

// The estimate of one pixel, or a sum of them: C + 2 (l0 linear[0] + l1 linear[1]) + l0^2 square[0]
// + l1^2 square[1] + 2 l0 l1 product, with l the shares.
struct SharesQuadratic {
  std::array<double, kFilterCount> linear{}, square{};
  double product = 0;
  // Without C.
  double At(const std::array<double, kFilterCount>& shares) const;
};

// The shares of at least 0 with a sum of at most 1 at which it is smallest; 0 if values are not
// finite.
std::array<double, kFilterCount> BestShares(const SharesQuadratic& quadratic);

// Planes over the pixels of an image. Thread safety: rows may be chosen, and then averaged,
// concurrently.
struct FilterTerms {
  FilterTerms(size_t width, size_t height);
  // Sets `terms` from `change`, `gain` and `importance`.
  void Multiply();
  // Chooses the shares of a row's pixels by the terms of the pixels at most `reach` away, adds the
  // changes to the color, and sets the row's `error`.
  void Choose(size_t y, int reach, std::array<std::vector<float>, 3>* color);
  // The root of the mean of `error` around the row's pixels.
  void AverageErrors(size_t y, int reach, std::array<std::vector<float>, 3>* root) const;
  // The means of `error` over pixels and colors, with importance and without.
  void SumErrors(double* relative, double* absolute) const;

  using Planes3 = std::array<std::vector<float>, 3>;
  const size_t width, height;
  std::array<Planes3, kFilterCount> change, gain;  // e and G of denoise.h.
  Planes3 variance;                                // C.
  Planes3 importance;                              // By which errors are weighed.
  Planes3 error;                                   // The chosen estimate.
  // Sums over R, G and B, by importance: the quadratic's linear, square, product.
  std::array<std::vector<float>, 5> terms;
};

}  // namespace sheaf
