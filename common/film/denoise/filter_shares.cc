// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/filter_shares.h"

#include <algorithm>

namespace sheaf {
namespace {

// The rows or columns at most `reach` from i, as [first, end).
struct Range {
  Range(size_t i, int reach, size_t size)
      : first(i < static_cast<size_t>(reach) ? 0 : i - static_cast<size_t>(reach)),
        end(std::min(i + static_cast<size_t>(reach) + 1, size)) {}
  size_t first, end;
};

// The share of at least 0 and at most 1 at which 2 l linear + l^2 square is smallest.
double BestShare(double linear, double square) {
  return linear < 0 ? (square > 0 ? std::min(-linear / square, 1.0) : 1.0) : 0;
}

}  // namespace

double SharesQuadratic::At(const Shares& shares) const {
  return shares[0] * (2 * linear[0] + shares[0] * square[0]) +
         shares[1] * (2 * linear[1] + shares[1] * square[1]) + 2 * shares[0] * shares[1] * product;
}

Shares BestShares(const SharesQuadratic& q) {
  Shares best{};
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

SharesQuadratic FilteredPixel::QuadraticOf(size_t component) const {
  const double first = double{change[0][component]}, second = double{change[1][component]};
  return {{double{gain[0][component]}, double{gain[1][component]}},
          {first * first, second * second},
          first * second};
}

double FilteredPixel::ChangeAt(const Shares& shares, size_t component) const {
  return shares[0] * double{change[0][component]} + shares[1] * double{change[1][component]};
}

double FilteredPixel::VarianceAt(const Shares& shares, size_t component) const {
  const double rest = 1 - shares[0] - shares[1];
  double sum = rest * rest * double{image_variance[component]} +
               shares[0] * shares[0] * double{variance[0][component]} +
               2 * shares[0] * shares[1] * double{variance[1][component]} +
               shares[1] * shares[1] * double{variance[2][component]};
  for (size_t f = 0; f < kFilterCount; ++f) {
    sum += 2 * rest * shares[f] * double{covariance[f][component]};
  }
  return sum;
}

double FilteredPixel::OwnWeightAt(const Shares& shares) const {
  return 1 - shares[0] * (1 - double{own_weight[0]}) - shares[1] * (1 - double{own_weight[1]});
}

ShareChoice::ShareChoice(size_t width, size_t height) : width_(width), height_(height) {
  for (std::vector<float>& plane : terms_) plane.resize(width * height);
}

void ShareChoice::Set(size_t p, const FilteredPixel& pixel) {
  std::array<double, 5> sums{};
  for (size_t i = 0; i < 3; ++i) {
    const double by = double{pixel.importance[i]};
    const SharesQuadratic of = pixel.QuadraticOf(i);
    const std::array<double, 5> values{of.linear[0], of.linear[1], of.square[0], of.square[1],
                                       of.product};
    for (size_t k = 0; k < sums.size(); ++k) sums[k] += by * values[k];
  }
  for (size_t k = 0; k < sums.size(); ++k) terms_[k][p] = static_cast<float>(sums[k]);
}

std::vector<Shares> ShareChoice::Choose(size_t y, int reach) const {
  std::array<std::vector<double>, 5> around;
  for (size_t k = 0; k < around.size(); ++k) {
    around[k] = SumSquares(terms_[k], width_, height_, y, reach);
    for (size_t x = 0; x < width_; ++x) around[k][x] -= double{terms_[k][y * width_ + x]};
  }
  std::vector<Shares> shares(width_);
  for (size_t x = 0; x < width_; ++x) {
    SharesQuadratic sum;
    sum.linear = {around[0][x], around[1][x]};
    sum.square = {around[2][x], around[3][x]};
    sum.product = around[4][x];
    shares[x] = BestShares(sum);
  }
  return shares;
}

}  // namespace sheaf
