// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/cell_errors.h"

#include <gtest/gtest.h>

#include <vector>

namespace sheaf::coordinator {
namespace {

// 64 pixels with the same error, except one with the error `outlier`.
ErrorSums CellOf(double error, double outlier) {
  return {64, 63 * error + outlier, 63 * error * error + outlier * outlier};
}

TEST(CellErrorsTest, CellsWithFewErrorsUseTheirTile) {
  const CellGrid grid({0, 0, 64, 32}, 32, 8);
  std::vector<ErrorSums> errors(32, CellOf(1, 1));
  errors[5] = CellOf(1, 1000);
  errors[20] = CellOf(3, 3);
  const std::vector<ErrorSums> before = errors;
  LeanOnTiles(grid, &errors);
  // The cell keeps a third of the bright pixel's error, as other cells of its tile may meet it,
  // too.
  EXPECT_NEAR(errors[5].sum, 0.47 * before[5].sum, 0.01 * before[5].sum);
  EXPECT_NEAR(errors[6].sum, 1.6 * before[6].sum, 0.05 * before[6].sum);
  // Cells with many contributing pixels hardly change, and tiles do not affect each other.
  EXPECT_NEAR(errors[20].sum, before[20].sum, 0.03 * before[20].sum);
  EXPECT_NEAR(errors[21].sum, before[21].sum, 0.03 * before[21].sum);
  for (const size_t first : {0, 16}) {  // The first cell of each tile.
    ErrorSums leaning, plain;
    for (size_t i = first; i < first + 16; ++i) {
      leaning.Add(errors[i]);
      plain.Add(before[i]);
    }
    EXPECT_NEAR(leaning.sum, plain.sum, 1e-12 * plain.sum);
    EXPECT_NEAR(leaning.square_sum, plain.square_sum, 1e-12 * plain.square_sum);
  }
}

TEST(CellErrorsTest, CellsWithoutErrorsKeepNone) {
  std::vector<ErrorSums> errors(4, ErrorSums{64, 0, 0});
  LeanOnTiles(CellGrid({0, 0, 16, 16}, 16, 8), &errors);
  for (const ErrorSums& error : errors) EXPECT_EQ(error.sum, 0);
  // Tiles of one cell do not change either.
  errors = {CellOf(1, 1000), CellOf(1, 1), CellOf(2, 5), CellOf(0, 0)};
  const std::vector<ErrorSums> before = errors;
  LeanOnTiles(CellGrid({0, 0, 16, 16}, 8, 8), &errors);
  for (size_t i = 0; i < errors.size(); ++i) EXPECT_EQ(errors[i].sum, before[i].sum);
}

}  // namespace
}  // namespace sheaf::coordinator
