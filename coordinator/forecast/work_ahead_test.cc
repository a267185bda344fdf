// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/work_ahead.h"

#include <random>
#include <vector>

#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

constexpr WorkLeft kOwn{.priority = 0, .sample_count = 100, .cpu_seconds_per_sample = 0.5};

TEST(WorkAheadTest, SingleJobTakesItsOwnTime) {
  EXPECT_DOUBLE_EQ(WorkAhead({kOwn}).CpuSeconds(kOwn), 50);
  EXPECT_EQ(WorkAhead().CpuSeconds(kOwn), 0);
}

TEST(WorkAheadTest, HigherPriorityGoesFirst) {
  EXPECT_DOUBLE_EQ(WorkAhead({{-1, 1e6, 9}, {1, 1000, 0.25}}).CpuSeconds(kOwn), 250);
}

TEST(WorkAheadTest, EqualPrioritiesGetEqualSamples) {
  EXPECT_DOUBLE_EQ(WorkAhead({{0, 1000, 2}, kOwn, {0, 10, 3}}).CpuSeconds(kOwn),
                   50 + 100 * 2 + 10 * 3);
}

TEST(WorkAheadTest, WeightsDivideSamples) {
  // Three samples of the other for each of its own, and then one of three of them.
  EXPECT_DOUBLE_EQ(WorkAhead({kOwn, {0, 1000, 2, 3}}).CpuSeconds(kOwn), 50 + 300 * 2);
  EXPECT_DOUBLE_EQ(WorkAhead({kOwn, {0, 1000, 2}}).CpuSeconds({0, 300, 0.5, 3}), 50 + 100 * 2);
}

TEST(WorkAheadTest, PartialJobsFinishFirst) {
  EXPECT_DOUBLE_EQ(WorkAhead({kOwn, {0, 1000, 2}}).CpuSeconds({0, 10, 0.5}), 5 + 20);
}

TEST(WorkAheadTest, UnknownCostsAreAssumedEqual) {
  EXPECT_DOUBLE_EQ(WorkAhead({{3, 20, 0}, {0, 1000, 0}, {0, 4, 0}}).CpuSeconds(kOwn), 10 + 50 + 2);
}

// Compares the sums with those of a loop over all jobs.
TEST(WorkAheadTest, ManyJobsAreSummed) {
  std::mt19937 random(5);
  const auto draw = [&](int values) { return static_cast<int>(random() % values); };
  std::vector<WorkLeft> jobs;
  for (int i = 0; i < 200; ++i) jobs.push_back({draw(5), 1.0 + draw(50), 0.25 * draw(4)});
  const WorkAhead ahead(jobs);
  for (const WorkLeft& own : jobs) {
    double expected = 0;
    for (const WorkLeft& job : jobs) {
      if (job.priority < own.priority) continue;
      const double samples = job.priority > own.priority
                                 ? job.sample_count
                                 : std::min(job.sample_count, own.sample_count);
      expected += samples * (job.cpu_seconds_per_sample > 0 ? job.cpu_seconds_per_sample
                                                            : own.cpu_seconds_per_sample);
    }
    EXPECT_NEAR(ahead.CpuSeconds(own), expected, 1e-9 * expected);
  }
}

TEST(WallSecondsTest, EarlierWorkDoesNotWidenTheInterval) {
  const FarmLoad load{2, WorkAhead({{1, 1000, 0.25}})};
  const Estimate wall = WallSeconds({50, 40, 70}, 100, 0, load);
  EXPECT_DOUBLE_EQ(wall.value, 150);
  EXPECT_DOUBLE_EQ(wall.low, 145);
  EXPECT_DOUBLE_EQ(wall.high, 160);
}

TEST(WallSecondsTest, NoWorkTakesNoTime) {
  const FarmLoad load{2, WorkAhead({{1, 1000, 0.25}})};
  EXPECT_EQ(WallSeconds({}, 0, 0, load).value, 0);
}

TEST(WallSecondsTest, UnknownWithoutWorkers) {
  EXPECT_EQ(WallSeconds({50, 40, 70}, 100, 0, {}).value, 0);
}

}  // namespace
}  // namespace sheaf::coordinator
