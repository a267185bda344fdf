// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/film/error/running_error.h"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

namespace sheaf {
namespace {

constexpr PixelRect kWindow{10, 20, 74, 68};

// An image of light and standard errors that vary from pixel to pixel; the first rows are empty.
FrameImage MakeImage(uint32_t seed) {
  FrameImage image;
  image.window = kWindow;
  image.frame_width_px = image.frame_height_px = 100;
  image.channel_names = {"R", "G", "B", "stderr.R", "stderr.G", "stderr.B", "samples", "nonfinite"};
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> level(0.2f, 1.0f);
  for (size_t i = 0; i < image.channel_names.size(); ++i) {
    std::vector<float> plane;
    for (int64_t p = 0; p < kWindow.PixelCount(); ++p) {
      const float samples = p < 100 ? 0.0f : 16.0f;
      plane.push_back(i == 7 ? 0.0f : i == 6 ? samples : (i < 3 ? 1.0f : 0.1f) * level(random));
    }
    image.planes.push_back(std::move(plane));
  }
  return image;
}

TEST(RunningErrorTest, MatchesTheWholeImageInitially) {
  const FrameImage image = MakeImage(1);
  const std::vector<PixelRect> tiles = CutTiles(kWindow, 16);
  std::vector<uint32_t> all(tiles.size());
  std::iota(all.begin(), all.end(), 0u);
  RunningError error(tiles);
  EXPECT_EQ(error.RelativeMse(), 0);
  error.Update(image, all);
  const double whole = EstimateError(image).relative_mse;
  EXPECT_GT(whole, 0);
  EXPECT_NEAR(error.RelativeMse(), whole, 1e-9 * whole);
}

TEST(RunningErrorTest, FollowsChangedTiles) {
  FrameImage image = MakeImage(1);
  const std::vector<PixelRect> tiles = CutTiles(kWindow, 16);
  RunningError error(tiles);
  std::vector<uint32_t> all(tiles.size());
  std::iota(all.begin(), all.end(), 0u);
  error.Update(image, all);
  const double before = error.RelativeMse();
  // Each tile's errors become a tenth, one tile after the other.
  for (uint32_t index : all) {
    for (size_t channel = 3; channel < 6; ++channel) {
      const PixelRect& tile = tiles[index];
      for (int32_t y = tile.y0; y < tile.y1; ++y) {
        for (int32_t x = tile.x0; x < tile.x1; ++x) {
          const auto p = static_cast<size_t>((y - kWindow.y0) * kWindow.Width() + x - kWindow.x0);
          image.planes[channel][p] *= 0.1f;
        }
      }
    }
    const double last = error.RelativeMse();
    error.Update(image, {&index, 1});
    EXPECT_LT(error.RelativeMse(), last);
  }
  const double whole = EstimateError(image).relative_mse;
  EXPECT_LT(whole, 0.1 * before);
  EXPECT_NEAR(error.RelativeMse(), whole, 0.05 * whole);
}

}  // namespace
}  // namespace sheaf
