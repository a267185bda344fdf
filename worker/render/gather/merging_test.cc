// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/gather/merging.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>

#include "common/film/film_tile.h"

namespace sheaf::render {
namespace {

TEST(MergingTest, RadiusIsTwoFootprintsAndScalesExactly) {
  EXPECT_FLOAT_EQ(MergeRadius(1e4), 0.02f);
  EXPECT_EQ(MergeRadius(0x1p-40 * 3e5), 0x1p20f * MergeRadius(3e5));
  EXPECT_EQ(MergeRadius(0x1p40 * 3e5), 0x1p-20f * MergeRadius(3e5));
  EXPECT_EQ(MergeRadius(0), 0);
  EXPECT_EQ(MergeRadius(-1), 0);
  EXPECT_EQ(MergeRadius(std::numeric_limits<double>::quiet_NaN()), 0);
}

TEST(MergingTest, RadiusShrinksWithThePassesOfAReplicate) {
  for (uint64_t pass = 0; pass < kReplicateCount; ++pass) EXPECT_EQ(MergeRadiusScale(pass), 1);
  EXPECT_FLOAT_EQ(MergeRadiusScale(63 * kReplicateCount), 0.5f);
  EXPECT_LT(MergeRadiusScale(kReplicateCount), 1);
}

TEST(MergingTest, LargeFramesStoreEachPixelOnceInSoManyPasses) {
  EXPECT_EQ(GatherStep(1), 1u);
  EXPECT_EQ(GatherStep(2'000'000), 1u);
  EXPECT_EQ(GatherStep(2'000'001), 2u);
  EXPECT_EQ(GatherStep(3'840 * 2'160), 5u);
  constexpr uint32_t kStep = 5;
  for (int64_t pixel = 0; pixel < 20; ++pixel) {
    for (uint64_t replicate = 0; replicate < kReplicateCount; ++replicate) {
      int count = 0;
      for (uint64_t i = 0; i < kStep; ++i) {
        count += GathersAt(3, pixel, replicate + i * kReplicateCount, kStep);
      }
      EXPECT_EQ(count, 1);
    }
    EXPECT_TRUE(GathersAt(3, pixel, 9, 1));
  }
}

TEST(MergingTest, PassesOfAReplicateDivideShutterAndSpectrumEvenly) {
  constexpr int kCount = 64;
  for (uint64_t replicate = 0; replicate < 3; ++replicate) {
    std::set<int> times, wavelengths;
    for (uint64_t i = 0; i < kCount; ++i) {
      const PassSample sample = MakePassSample(5, replicate + i * kReplicateCount, false);
      times.insert(static_cast<int>(sample.time * kCount));
      wavelengths.insert(static_cast<int>(sample.wavelengths * kCount));
    }
    EXPECT_EQ(times.size(), size_t{kCount});
    EXPECT_EQ(wavelengths.size(), size_t{kCount});
  }
}

}  // namespace
}  // namespace sheaf::render
