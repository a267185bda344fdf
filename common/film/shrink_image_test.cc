// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/shrink_image.h"

#include "gtest/gtest.h"

namespace sheaf {
namespace {

TEST(ShrinkImageTest, UsesTheSmallestFactorThatFits) {
  EXPECT_EQ(ShrinkFactor(100, 50, 5000), 1);
  EXPECT_EQ(ShrinkFactor(100, 50, 4999), 2);
  EXPECT_EQ(ShrinkFactor(1920, 1080, 1 << 14), 12);
  // A strip keeps at least one row.
  EXPECT_EQ(ShrinkFactor(10000, 2, 100), 2);
}

TEST(ShrinkImageTest, AveragesColorsAndSquaredErrors) {
  FrameImage image;
  image.window = {10, 20, 15, 22};  // 5 x 2: the last column is left over.
  image.frame_width_px = image.frame_height_px = 64;
  image.channel_names = {"R", "stderr.R"};
  image.planes = {{1, 2, 3, 4, 100, 5, 6, 7, 8, 100}, {0, 3, 1, 1, 9, 4, 5, 1, 1, 9}};
  const auto small = ShrinkImage(image, {"stderr.R", "R"}, 2);
  ASSERT_TRUE(small.ok()) << small.status();
  EXPECT_EQ(small->window, (PixelRect{0, 0, 2, 1}));
  EXPECT_EQ(small->channel_names, (std::vector<std::string>{"stderr.R", "R"}));
  EXPECT_FLOAT_EQ(small->planes[0][0], std::sqrt(50.0f / 4));
  EXPECT_FLOAT_EQ(small->planes[0][1], 1);
  EXPECT_EQ(small->planes[1], (std::vector<float>{3.5f, 5.5f}));
  EXPECT_FALSE(ShrinkImage(image, {"G"}, 2).ok());
}

}  // namespace
}  // namespace sheaf
