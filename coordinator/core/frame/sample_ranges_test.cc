// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/sample_ranges.h"

#include <algorithm>
#include <random>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

TEST(SampleRangesTest, AddJoinsAdjacentAndOverlapping) {
  SampleRanges ranges;
  ranges.Add({8, 12});
  ranges.Add({0, 4});
  ranges.Add({4, 6});
  ASSERT_EQ(ranges.ranges().size(), 2u);
  EXPECT_EQ(ranges.ranges()[0], (SampleRanges::Range{0, 6}));
  ranges.Add({5, 9});
  ASSERT_EQ(ranges.ranges().size(), 1u);
  EXPECT_EQ(ranges.ranges()[0], (SampleRanges::Range{0, 12}));
}

TEST(SampleRangesTest, FirstBlockIsTheLargestAlignedOneThatFits) {
  SampleRanges ranges({0, 100});
  EXPECT_EQ(ranges.FirstBlock(1024), (SampleBlock{0, 64}));
  EXPECT_EQ(ranges.FirstBlock(16), (SampleBlock{0, 16}));
  ranges.Remove({0, 16});
  EXPECT_EQ(ranges.FirstBlock(1024), (SampleBlock{16, 16}));
  ranges.Remove({16, 96});
  EXPECT_EQ(ranges.FirstBlock(1024), (SampleBlock{96, 4}));
}

TEST(SampleRangesTest, AgreesWithASetOfFlags) {
  std::mt19937 random(7);
  SampleRanges ranges;
  std::vector<bool> flags(64, false);
  for (int step = 0; step < 2000; ++step) {
    const uint64_t first = random() % 64, end = first + 1 + random() % (64 - first);
    const bool add = random() % 2 == 0;
    bool all = true, any = false;
    for (uint64_t i = first; i < end; ++i) {
      all = all && flags[i];
      any = any || flags[i];
    }
    EXPECT_EQ(ranges.Contains({first, end}), all);
    EXPECT_EQ(ranges.Overlaps({first, end}), any);
    add ? ranges.Add({first, end}) : ranges.Remove({first, end});
    for (uint64_t i = first; i < end; ++i) flags[i] = add;
    EXPECT_EQ(ranges.SampleCount(),
              static_cast<uint64_t>(std::count(flags.begin(), flags.end(), true)));
  }
}

}  // namespace
}  // namespace sheaf::coordinator
