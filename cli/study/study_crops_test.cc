// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_crops.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

constexpr PixelRect kWindow{0, 0, 640, 480};

struct Tiles {
  std::vector<PixelRect> rects;
  std::vector<double> errors, pixel_counts;
};

// One tile in the middle of each field of 64 x 48 pixels, with these errors of a pixel in the row
// at the top, and 0.1 elsewhere.
Tiles MakeTiles(const std::vector<double>& top) {
  Tiles tiles;
  for (int32_t y = 16; y < kWindow.y1; y += 48) {
    for (int32_t x = 24; x < kWindow.x1; x += 64) {
      const auto column = static_cast<size_t>(x / 64);
      tiles.rects.push_back({x, y, x + 16, y + 16});
      tiles.errors.push_back(256 * (y == 16 && column < top.size() ? top[column] : 0.1));
      tiles.pixel_counts.push_back(256);
    }
  }
  return tiles;
}

TEST(StudyCropsTest, PricesDifferByFourWhereTimeAllows) {
  EXPECT_EQ(PlanCrops(1e9).blocks, (std::vector<uint64_t>{4, 16, 64, 256}));
  EXPECT_EQ(PlanCrops(1e9).width_px, 192);
  const CropPlan least = PlanCrops(0);
  EXPECT_EQ(least.blocks, (std::vector<uint64_t>{1, 2, 4, 8}));
  EXPECT_EQ(least.width_px, 64);
  // 2 x 24 tiles of 64 blocks.
  EXPECT_EQ(PlanCrops(2 * 24 * 64).width_px, 96);
  EXPECT_EQ(PlanCrops(2 * 24 * 64).blocks.back(), 64u);
}

TEST(StudyCropsTest, PricesHaveNoMoreBlocksThanAllowed) {
  EXPECT_EQ(PlanCrops(1e9, 70).blocks, (std::vector<uint64_t>{1, 4, 16, 64}));
  EXPECT_EQ(PlanCrops(1e9, 5).blocks, (std::vector<uint64_t>{1, 2, 4}));
  EXPECT_EQ(PlanCrops(0, 1).blocks, (std::vector<uint64_t>{1}));
}

TEST(StudyCropsTest, RegionsAreTheWorstAndAUsualOne) {
  const Tiles tiles = MakeTiles({0.01, 0.3, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 5, 0.01});
  const CropPlan plan = PlanCrops(0);
  const std::vector<CropRegion> regions =
      ChooseCrops(kWindow, plan, tiles.rects, tiles.errors, tiles.pixel_counts);
  ASSERT_EQ(regions.size(), 2u);
  EXPECT_EQ(regions[0].kind, CropKind::kLargestError);
  EXPECT_EQ(regions[0].rect, (PixelRect{512, 0, 576, 48}));
  EXPECT_EQ(regions[1].kind, CropKind::kRepresentative);
  // The mean over all 100 tiles is 0.144: 0.1 is nearer to it than 0.3.
  EXPECT_GE(regions[1].rect.y0, 48);
  for (const CropRegion& region : regions) {
    EXPECT_TRUE(kWindow.Contains(region.rect));
    EXPECT_EQ(region.rect.Width(), plan.width_px);
    EXPECT_EQ(region.rect.Height(), plan.height_px);
  }
}

TEST(StudyCropsTest, AnImageOfOneRegionHasOneCrop) {
  const PixelRect window{10, 10, 42, 26};
  const std::vector<CropRegion> regions =
      ChooseCrops(window, PlanCrops(0), {{10, 10, 26, 26}, {26, 10, 42, 26}}, {1, 2}, {256, 256});
  ASSERT_EQ(regions.size(), 1u);
  EXPECT_EQ(regions[0].rect, window);
}

}  // namespace
}  // namespace sheaf::cli
