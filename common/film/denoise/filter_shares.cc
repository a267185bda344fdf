// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/filter_shares.h"

#include <algorithm>
#include <cmath>

namespace sheaf {
namespace {

// The rows or columns at most `reach` from i, as [first, end).
struct Range {
  Range(size_t i, int reach, size_t size)
      : first(i < static_cast<size_t>(reach) ? 0 : i - static_cast<size_t>(reach)),
        end(std::min(i + static_cast<size_t>(reach) + 1, size)) {}
  size_t first, end;
};

// Sums of a plane over the squares around a row's pixels, always in the same order.
std::vector<double> SumSquares(const std::vector<float>& plane, size_t width, size_t height,
                               size_t y, int reach) {
  std::vector<double> columns(width), sums(width);
  const Range rows(y, reach, height);
  for (size_t j = rows.first; j < rows.end; ++j) {
    for (size_t x = 0; x < width; ++x) columns[x] += double{plane[j * width + x]};
  }
  for (size_t x = 0; x < width; ++x) {
    const Range range(x, reach, width);
    for (size_t i = range.first; i < range.end; ++i) sums[x] += columns[i];
  }
  return sums;
}

// The share of at least 0 and at most 1 at which 2 l linear + l^2 square is smallest.
double BestShare(double linear, double square) {
  return linear < 0 ? (square > 0 ? std::min(-linear / square, 1.0) : 1.0) : 0;
}

}  // namespace

double SharesQuadratic::At(const std::array<double, kFilterCount>& shares) const {
  return shares[0] * (2 * linear[0] + shares[0] * square[0]) +
         shares[1] * (2 * linear[1] + shares[1] * square[1]) + 2 * shares[0] * shares[1] * product;
}

std::array<double, kFilterCount> BestShares(const SharesQuadratic& q) {
  std::array<double, kFilterCount> best{};
  double best_value = 0;
  const auto consider = [&](double first, double second) {
    const double value = q.At({first, second});
    if (!(value < best_value)) return;
    best_value = value;
    best = {first, second};
  };
  consider(BestShare(q.linear[0], q.square[0]), 0);
  consider(0, BestShare(q.linear[1], q.square[1]));
  // Along first + second = 1.
  const double slope = q.linear[0] - q.linear[1] + q.product - q.square[1];
  const double first = BestShare(slope, q.square[0] + q.square[1] - 2 * q.product);
  consider(first, 1 - first);
  const double determinant = q.square[0] * q.square[1] - q.product * q.product;
  if (determinant > 0) {
    const double l0 = (q.linear[1] * q.product - q.linear[0] * q.square[1]) / determinant;
    const double l1 = (q.linear[0] * q.product - q.linear[1] * q.square[0]) / determinant;
    if (l0 >= 0 && l1 >= 0 && l0 + l1 <= 1) consider(l0, l1);
  }
  return best;
}

FilterTerms::FilterTerms(size_t width_px, size_t height_px) : width(width_px), height(height_px) {
  const auto allocate = [&](Planes3* planes) {
    for (std::vector<float>& plane : *planes) plane.resize(width * height);
  };
  for (size_t f = 0; f < kFilterCount; ++f) {
    allocate(&change[f]);
    allocate(&gain[f]);
  }
  allocate(&variance);
  allocate(&importance);
  allocate(&error);
  for (std::vector<float>& plane : terms) plane.resize(width * height);
}

void FilterTerms::Multiply() {
  for (size_t p = 0; p < width * height; ++p) {
    std::array<double, 5> sums{};
    for (size_t i = 0; i < 3; ++i) {
      const double by = double{importance[i][p]};
      const double first = double{change[0][i][p]}, second = double{change[1][i][p]};
      sums[0] += by * double{gain[0][i][p]};
      sums[1] += by * double{gain[1][i][p]};
      sums[2] += by * first * first;
      sums[3] += by * second * second;
      sums[4] += by * first * second;
    }
    for (size_t k = 0; k < sums.size(); ++k) terms[k][p] = static_cast<float>(sums[k]);
  }
}

void FilterTerms::Choose(size_t y, int reach, Planes3* color) {
  std::array<std::vector<double>, 5> around;
  for (size_t k = 0; k < around.size(); ++k) {
    around[k] = SumSquares(terms[k], width, height, y, reach);
  }
  for (size_t x = 0; x < width; ++x) {
    const size_t p = y * width + x;
    SharesQuadratic sum;
    sum.linear = {around[0][x], around[1][x]};
    sum.square = {around[2][x], around[3][x]};
    sum.product = around[4][x];
    const std::array<double, kFilterCount> shares = BestShares(sum);
    for (size_t i = 0; i < 3; ++i) {
      SharesQuadratic own;
      double changed = 0;
      for (size_t f = 0; f < kFilterCount; ++f) {
        const double e = double{change[f][i][p]};
        own.linear[f] = double{gain[f][i][p]};
        own.square[f] = e * e;
        changed += shares[f] * e;
      }
      own.product = double{change[0][i][p]} * double{change[1][i][p]};
      (*color)[i][p] += static_cast<float>(changed);
      error[i][p] = static_cast<float>(double{variance[i][p]} + own.At(shares));
    }
  }
}

void FilterTerms::AverageErrors(size_t y, int reach, Planes3* root) const {
  const Range rows(y, reach, height);
  for (size_t i = 0; i < 3; ++i) {
    const std::vector<double> sums = SumSquares(error[i], width, height, y, reach);
    for (size_t x = 0; x < width; ++x) {
      const Range columns(x, reach, width);
      const auto count =
          static_cast<double>((rows.end - rows.first) * (columns.end - columns.first));
      (*root)[i][y * width + x] = static_cast<float>(std::sqrt(std::max(sums[x] / count, 0.0)));
    }
  }
}

void FilterTerms::SumErrors(double* relative, double* absolute) const {
  double by_importance = 0, plain = 0;
  for (size_t i = 0; i < 3; ++i) {
    for (size_t p = 0; p < width * height; ++p) {
      by_importance += double{error[i][p]} * double{importance[i][p]};
      plain += double{error[i][p]};
    }
  }
  const auto count = static_cast<double>(3 * width * height);
  *relative = by_importance / count;
  *absolute = plain / count;
}

}  // namespace sheaf
