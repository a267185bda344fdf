// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/pixel_lattice.h"

#include <gtest/gtest.h>

#include <vector>

namespace sheaf {
namespace {

using Part = PixelLattice::Part;

TEST(PixelLatticeTest, SelectsOneBlockPerCell) {
  for (const int32_t stride : {6, 7, 32}) {
    const PixelLattice lattice{stride};
    for (int32_t cell_y = 0; cell_y < 5; ++cell_y) {
      for (int32_t cell_x = 0; cell_x < 5; ++cell_x) {
        const PixelRect block = lattice.BlockOf(cell_x, cell_y);
        EXPECT_EQ(block.PixelCount(), 25);
        int core = 0, rim = 0;
        for (int32_t y = 0; y < stride; ++y) {
          for (int32_t x = 0; x < stride; ++x) {
            const Part part = lattice.PartOf(cell_x * stride + x, cell_y * stride + y);
            core += part == Part::kCore ? 1 : 0;
            rim += part == Part::kRim ? 1 : 0;
          }
        }
        ASSERT_EQ(core, 9) << stride << ": " << cell_x << " " << cell_y;
        ASSERT_EQ(rim, 16);
        ASSERT_EQ(lattice.PartOf(block.x0, block.y0), Part::kRim);
        ASSERT_EQ(lattice.PartOf(block.x0 + 1, block.y0 + 1), Part::kCore);
      }
    }
  }
  EXPECT_EQ(PixelLattice().PartOf(3, 4), Part::kCore);
}

TEST(PixelLatticeTest, CountsPixelsInAnyRectangle) {
  for (const int32_t stride : {1, 6, 8}) {
    const PixelLattice lattice{stride};
    for (const PixelRect& rect : {PixelRect{0, 0, 32, 32}, PixelRect{5, 7, 6, 8},
                                  PixelRect{13, 2, 50, 41}, PixelRect{8, 8, 8, 8}}) {
      int64_t count = 0;
      uint64_t samples = 0;
      for (int32_t y = rect.y0; y < rect.y1; ++y) {
        for (int32_t x = rect.x0; x < rect.x1; ++x) {
          const Part part = lattice.PartOf(x, y);
          count += part == Part::kCore ? 1 : 0;
          samples += lattice.SamplesOf(part, {0, 16}).count;
        }
      }
      EXPECT_EQ(lattice.CountIn(rect), count) << stride << ": " << rect.x0 << " " << rect.y0;
      EXPECT_EQ(lattice.SampleCountIn(rect, 16), samples);
    }
  }
  EXPECT_DOUBLE_EQ(PixelLattice{8}.SamplesPerPixel(16), (9 * 16 + 16 * 4) / 64.0);
  EXPECT_DOUBLE_EQ(PixelLattice().SamplesPerPixel(16), 16);
}

TEST(PixelLatticeTest, SeedsMoveTheBlocks) {
  int same = 0;
  for (int32_t x = 0; x < 1600; ++x) {
    same += PixelLattice{8, 1}.BlockOf(x, 5) == PixelLattice{8, 2}.BlockOf(x, 5) ? 1 : 0;
  }
  EXPECT_NEAR(same, 100, 40);  // One in 16 positions; four deviations.
}

TEST(PixelLatticeTest, BlockBordersHaveOnlyTheFirstSamples) {
  const PixelLattice lattice{8};
  const auto rim = [&](SampleBlock block) { return lattice.SamplesOf(Part::kRim, block); };
  EXPECT_EQ(rim({0, 16}), (SampleBlock{0, 4}));
  EXPECT_EQ(rim({2, 2}), (SampleBlock{2, 2}));
  EXPECT_EQ(rim({16, 16}).count, 0u);
  EXPECT_EQ(lattice.SamplesOf(Part::kOutside, {0, 16}).count, 0u);
  EXPECT_EQ(lattice.SamplesOf(Part::kCore, {16, 16}), (SampleBlock{16, 16}));
}

// Chi-square of the position in the cell, 10,000 cells and 15 degrees of freedom: above 46 with a
// probability of 5e-5.
TEST(PixelLatticeTest, BlocksAreUniformInTheirCells) {
  const PixelLattice lattice{8};
  std::vector<int> counts(16);
  for (int32_t y = 0; y < 100; ++y) {
    for (int32_t x = 0; x < 100; ++x) {
      const PixelRect block = lattice.BlockOf(x, y);
      ++counts[static_cast<size_t>((block.y0 - 8 * y) * 4 + block.x0 - 8 * x)];
    }
  }
  const double expected = 10'000.0 / 16;
  double chi_square = 0;
  for (const int count : counts) chi_square += (count - expected) * (count - expected) / expected;
  EXPECT_LT(chi_square, 46);
}

}  // namespace
}  // namespace sheaf
