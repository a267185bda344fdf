// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/denoise/filter_shares.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace sheaf {
namespace {

using ::testing::ElementsAre;

TEST(FilterSharesTest, KeepsTheImageWhereFiltersHarm) {
  EXPECT_EQ(BestShares({{0.1, 0.2}, {1, 1}, 0.5}), Shares());
}

TEST(FilterSharesTest, TakesTheFilterThatGains) {
  const Shares shares = BestShares({{-0.5, 0.1}, {1, 1}, 0});
  EXPECT_DOUBLE_EQ(shares[0], 0.5);
  EXPECT_DOUBLE_EQ(shares[1], 0);
}

// No pair of shares on a grid is better.
TEST(FilterSharesTest, IsBestAmongAll) {
  for (const double product : {-0.4, 0.0, 0.3, 0.9}) {
    const SharesQuadratic quadratic{{-0.7, -0.6}, {1, 0.8}, product};
    const double best = quadratic.At(BestShares(quadratic));
    for (int i = 0; i <= 20; ++i) {
      for (int j = 0; i + j <= 20; ++j) {
        EXPECT_GE(quadratic.At({i / 20.0, j / 20.0}), best - 1e-12) << product;
      }
    }
  }
}

TEST(FilterSharesTest, KeepsTheImageWithoutFiniteValues) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(BestShares({{nan, nan}, {nan, nan}, nan}), Shares());
}

TEST(FilterSharesTest, SumsSquaresWithinTheImage) {
  const std::vector<float> plane{1, 2, 3, 4, 5, 6};
  EXPECT_THAT(SumSquares(plane, 3, 2, 0, 1), ElementsAre(12, 21, 16));
}

// A pixel's own estimate does not choose its shares.
TEST(FilterSharesTest, ChoosesByOtherPixels) {
  ShareChoice choice(3, 1);
  FilteredPixel gains, harms;
  gains.importance = harms.importance = {1, 1, 1};
  gains.gain[kGuided] = {-1, -1, -1};
  gains.change[kGuided] = harms.change[kGuided] = {1, 1, 1};
  harms.gain[kGuided] = {5, 5, 5};
  choice.Set(0, gains);
  choice.Set(1, harms);
  choice.Set(2, gains);
  const std::vector<Shares> shares = choice.Choose(0, 1);
  EXPECT_EQ(shares[0], Shares());
  EXPECT_EQ(shares[1][kGuided], 1);
}

}  // namespace
}  // namespace sheaf
