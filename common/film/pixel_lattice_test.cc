// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/pixel_lattice.h"

#include <gtest/gtest.h>

#include <vector>

namespace sheaf {
namespace {

TEST(PixelLatticeTest, TakesOneBlockOfEachCell) {
  for (const int32_t stride : {4, 7, 32}) {
    const PixelLattice lattice{stride};
    for (int32_t cell_y = 0; cell_y < 5; ++cell_y) {
      for (int32_t cell_x = 0; cell_x < 5; ++cell_x) {
        const PixelRect block = lattice.BlockOf(cell_x, cell_y);
        EXPECT_EQ(block.PixelCount(), 9);
        int count = 0;
        for (int32_t y = 0; y < stride; ++y) {
          for (int32_t x = 0; x < stride; ++x) {
            count += lattice.Has(cell_x * stride + x, cell_y * stride + y) ? 1 : 0;
          }
        }
        ASSERT_EQ(count, 9) << stride << ": " << cell_x << " " << cell_y;
        ASSERT_TRUE(lattice.Has(block.x0, block.y0) && lattice.Has(block.x1 - 1, block.y1 - 1));
      }
    }
    EXPECT_DOUBLE_EQ(lattice.Share(), 9.0 / (stride * stride));
  }
  EXPECT_TRUE(PixelLattice().Has(3, 4));
}

TEST(PixelLatticeTest, CountsWhatItHasInAnyRectangle) {
  for (const int32_t stride : {1, 4, 8}) {
    const PixelLattice lattice{stride};
    for (const PixelRect& rect : {PixelRect{0, 0, 32, 32}, PixelRect{5, 7, 6, 8},
                                  PixelRect{13, 2, 50, 41}, PixelRect{8, 8, 8, 8}}) {
      int64_t count = 0;
      for (int32_t y = rect.y0; y < rect.y1; ++y) {
        for (int32_t x = rect.x0; x < rect.x1; ++x) count += lattice.Has(x, y) ? 1 : 0;
      }
      EXPECT_EQ(lattice.CountIn(rect), count) << stride << ": " << rect.x0 << " " << rect.y0;
    }
  }
}

// Chi-square of the place in the cell, 10,000 cells and 35 degrees of freedom: beyond 77 with a
// probability of 5e-5.
TEST(PixelLatticeTest, EveryPlaceInACellIsAsLikely) {
  const PixelLattice lattice{8};
  std::vector<int> counts(36);
  for (int32_t y = 0; y < 100; ++y) {
    for (int32_t x = 0; x < 100; ++x) {
      const PixelRect block = lattice.BlockOf(x, y);
      ++counts[static_cast<size_t>((block.y0 - 8 * y) * 6 + block.x0 - 8 * x)];
    }
  }
  const double expected = 10'000.0 / 36;
  double chi_square = 0;
  for (const int count : counts) chi_square += (count - expected) * (count - expected) / expected;
  EXPECT_LT(chi_square, 77);
}

}  // namespace
}  // namespace sheaf
