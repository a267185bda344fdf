// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/placement/lease_length.h"

#include <algorithm>
#include <functional>
#include <queue>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr int64_t kTilePixels = 32 * 32;

LeaseLength LongFrame() {
  return {.samples_per_second = 65536,
          .target_seconds = 10,
          .samples_left = 1e12,
          .slots = 16,
          .pixel_count = kTilePixels,
          .pass_samples = 16,
          .passes_max = 1024};
}

TEST(LeaseLengthTest, LongFramesGetLeasesOfTheTarget) {
  // 640 samples per pixel, to the nearest power of two.
  EXPECT_EQ(LeaseSamples(LongFrame(), Limits()), 512u);
  LeaseLength slower = LongFrame();
  slower.samples_per_second /= 100;
  EXPECT_EQ(LeaseSamples(slower, Limits()), 16u);
  LeaseLength faster = LongFrame();
  faster.samples_per_second *= 1000;
  EXPECT_EQ(LeaseSamples(faster, Limits()), 16u * 1024);
}

TEST(LeaseLengthTest, UnknownSpeedGetsOnePass) {
  LeaseLength unknown = LongFrame();
  unknown.samples_per_second = 0;
  EXPECT_EQ(LeaseSamples(unknown, Limits()), 16u);
}

TEST(LeaseLengthTest, FirstLeasesHaveALimit) {
  LeaseLength first = LongFrame();
  first.samples_max = 128;
  EXPECT_EQ(LeaseSamples(first, Limits()), 128u);
}

TEST(LeaseLengthTest, LeasesShrinkWithWhatIsLeft) {
  LeaseLength length = LongFrame();
  uint64_t last = 512;
  for (double left = 1e9; left > 1; left /= 2) {
    length.samples_left = left;
    const uint64_t samples = LeaseSamples(length, Limits());
    EXPECT_LE(samples, last);
    const double bound = left / (2.0 * 16 * kTilePixels);
    EXPECT_LE(static_cast<double>(samples), std::max(16.0, bound));
    last = samples;
  }
  EXPECT_EQ(last, 16u);
}

struct Ends {
  double first_idle = 0, last = 0, leases = 0, longest = 0;
};

// Slots that take leases until nothing is left. A sample costs up to four times as much in one
// lease as in another.
Ends Play(int slots, double tail_divisor) {
  Limits limits;
  limits.tail_divisor = tail_divisor;
  LeaseLength length = LongFrame();
  length.slots = slots;
  length.samples_left = 20.0 * slots * 65536 * 10;  // 200 s.
  std::priority_queue<double, std::vector<double>, std::greater<>> free;
  for (int i = 0; i < slots; ++i) free.push(0);
  Ends ends;
  uint32_t state = 1;
  while (length.samples_left > 0) {
    const double begin = free.top();
    free.pop();
    state = state * 1664525 + 1013904223;
    const double cost = 0.4 + 1.2 * (state >> 8) / (1 << 24);
    const double samples = std::min(
        length.samples_left, static_cast<double>(LeaseSamples(length, limits)) * kTilePixels);
    const double seconds = cost * samples / length.samples_per_second;
    length.samples_left -= samples;
    ends.last = std::max(ends.last, begin + seconds);
    ends.longest = std::max(ends.longest, seconds);
    ++ends.leases;
    free.push(begin + seconds);
  }
  ends.first_idle = free.top();
  return ends;
}

TEST(LeaseLengthTest, TheLastLeasesEndTogether) {
  for (const int slots : {1, 16, 200}) {
    SCOPED_TRACE(slots);
    const Ends factored = Play(slots, Limits().tail_divisor);
    EXPECT_LT(factored.last - factored.first_idle, 1.0);
    EXPECT_GT(factored.longest, 5.0);
    EXPECT_LT(factored.leases / slots, 50);
  }
  // Leases of one length to the end wait for each other.
  const Ends equal = Play(200, 1e-9);
  EXPECT_GT(equal.last - equal.first_idle, 4.0);
}

}  // namespace
}  // namespace sheaf::coordinator
