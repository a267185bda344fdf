// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/clamped_tiles.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

constexpr PixelRect kTile{0, 0, 2, 1};

// One sample of each replicate: in pixel 0 all are 1; in pixel 1 one is 160 and the others are 0.
FilmTile MakePart(SampleBlock block) {
  FilmTile part(kTile, block);
  PixelAccumulator accumulator(&part);
  for (int32_t x = 0; x < 2; ++x) {
    accumulator.Begin(x, 0);
    for (uint64_t n = block.first; n < block.End(); ++n) {
      const float value = x == 0 ? 1.0f : n % kReplicateCount == 3 ? 160.0f : 0.0f;
      accumulator.Add(n, FilmSample{.radiance = {value, value / 2, 0}});
    }
    accumulator.End();
  }
  return part;
}

TEST(ClampedTilesTest, OnlyBrighterValuesAreClamped) {
  ClampedTiles clamped({kTile}, 16);
  clamped.Add(0, MakePart({0, kReplicateCount}));
  clamped.Add(0, MakePart({kReplicateCount, kReplicateCount}));
  const TilePixels pixels = clamped.Develop(0);
  EXPECT_FLOAT_EQ(pixels.value[0][0], 1);
  EXPECT_FLOAT_EQ(pixels.deviation[0][0], 0);
  // Clamping keeps its color.
  EXPECT_FLOAT_EQ(pixels.value[1][0], 1);
  EXPECT_FLOAT_EQ(pixels.value[1][1], 0.5f);
  // One replicate of 16 contains all the light, so the deviation equals the mean.
  EXPECT_FLOAT_EQ(pixels.deviation[1][0], 1);
}

TEST(ClampedTilesTest, ValuesBelowTheLimitAreKept) {
  ClampedTiles clamped({kTile}, 1000);
  clamped.Add(0, MakePart({0, kReplicateCount}));
  EXPECT_FLOAT_EQ(clamped.Develop(0).value[1][0], 10);
}

}  // namespace
}  // namespace sheaf::cli
