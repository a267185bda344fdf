// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/yield/yielding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::worker {
namespace {

using ::testing::HasSubstr;

constexpr uint64_t kGiB = uint64_t{1} << 30;

// A machine whose seconds pass as the test says.
class Machine {
 public:
  explicit Machine(const YieldOptions& options) : yielding_(options) {}

  // Some seconds later; processors: that other programs used meanwhile.
  std::string After(int seconds, double processors = 0) {
    std::string why;
    for (int i = 0; i < seconds; ++i) {
      now_ += absl::Seconds(1);
      used_ += processors;
      why = yielding_.WhyAway(now_, local, {used_, available}, scene_bytes);
    }
    return why;
  }

  absl::CivilMinute local{2024, 1, 1, 12, 0};
  uint64_t available = 8 * kGiB;
  uint64_t scene_bytes = 0;

 private:
  Yielding yielding_;
  SteadyTime now_ = SteadyTime() + absl::Hours(1);
  double used_ = 0;
};

TEST(YieldingTest, WithoutLimitsTheWorkerStays) {
  Machine machine({});
  machine.available = 1;
  EXPECT_EQ(machine.After(60, 64), "");
}

TEST(YieldingTest, HoursBeginAndEndAtOnce) {
  Machine machine({WorkingHours::Parse("19:00-07:00").value(), {}, 0});
  EXPECT_THAT(machine.After(1), HasSubstr("outside its hours"));
  machine.local = absl::CivilMinute(2024, 1, 1, 19, 0);
  EXPECT_EQ(machine.After(1), "");
  machine.local = absl::CivilMinute(2024, 1, 2, 7, 0);
  EXPECT_THAT(machine.After(1), HasSubstr("--hours"));
}

TEST(YieldingTest, LoadOfOthersSendsItAwayAndCalmBringsItBack) {
  YieldOptions options;
  options.processors_max = 1;
  Machine machine(options);
  EXPECT_EQ(machine.After(60, 0.5), "");
  EXPECT_EQ(machine.After(1, 2), "");  // A short burst is no load.
  EXPECT_THAT(machine.After(10, 2), HasSubstr("other programs use 2.0 processors"));
  // The mean falls below the limit within half a window; then two minutes of calm.
  EXPECT_NE(machine.After(5 + 115), "");
  EXPECT_EQ(machine.After(5), "");
}

TEST(YieldingTest, LoadDuringTheCalmStartsItAgain) {
  YieldOptions options;
  options.processors_max = 1;
  Machine machine(options);
  EXPECT_NE(machine.After(30, 4), "");
  EXPECT_NE(machine.After(100), "");
  EXPECT_NE(machine.After(10, 4), "");
  EXPECT_NE(machine.After(100), "");
  EXPECT_EQ(machine.After(60), "");
}

TEST(YieldingTest, LackOfMemorySendsItAwayUntilItsScenesFitToo) {
  YieldOptions options;
  options.memory_available_min = 2 * kGiB;
  Machine machine(options);
  machine.scene_bytes = 3 * kGiB;
  EXPECT_EQ(machine.After(10), "");
  machine.available = kGiB;
  EXPECT_THAT(machine.After(1), HasSubstr("1.0 GiB of memory are available"));
  // It dropped its scenes. Memory that it gave back is no reason to return.
  machine.scene_bytes = 0;
  machine.available = 4 * kGiB;
  EXPECT_NE(machine.After(600), "");
  machine.available = 5 * kGiB;
  EXPECT_NE(machine.After(119), "");
  EXPECT_EQ(machine.After(2), "");
  // Memory that it takes now counts anew.
  machine.scene_bytes = kGiB;
  machine.available = 3 * kGiB;
  EXPECT_EQ(machine.After(10), "");
}

TEST(YieldingTest, UnknownReadingsAreNoReason) {
  YieldOptions options;
  options.processors_max = 1;
  options.memory_available_min = kGiB;
  Yielding yielding(options);
  SteadyTime now = SteadyTime() + absl::Hours(1);
  for (int i = 0; i < 60; ++i) {
    now += absl::Seconds(1);
    EXPECT_EQ(yielding.WhyAway(now, absl::CivilMinute(2024, 1, 1), {}, 0), "");
  }
}

}  // namespace
}  // namespace sheaf::worker
