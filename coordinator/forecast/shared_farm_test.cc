// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/shared_farm.h"

#include <random>
#include <vector>

#include "coordinator/forecast/work_ahead.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

SharedJob Job(uint64_t id, int32_t priority, double samples, double cost, double weight = 1) {
  return {id, {priority, samples, cost, weight}, 0.5};
}

double SecondsOf(const SharedFarm& farm, uint64_t id) {
  const SharedFarm::End* end = farm.Find(id);
  return end == nullptr ? -1 : end->wall_seconds.value;
}

TEST(SharedFarmTest, SingleJobTakesItsOwnTime) {
  const SharedFarm farm({Job(1, 0, 100, 0.5)}, 2);
  EXPECT_DOUBLE_EQ(SecondsOf(farm, 1), 25);
  EXPECT_DOUBLE_EQ(farm.Find(1)->alone_seconds, 25);
  EXPECT_EQ(farm.Find(2), nullptr);
}

// Another job takes half of the farm, and then ends: the rest does not continue at half the speed.
TEST(SharedFarmTest, ForecastsCountWithTheEndsOfOthers) {
  const SharedFarm farm({Job(1, 0, 1000, 1), Job(2, 0, 100, 1)}, 1);
  EXPECT_DOUBLE_EQ(SecondsOf(farm, 2), 200);
  EXPECT_DOUBLE_EQ(SecondsOf(farm, 1), 1100);
  EXPECT_DOUBLE_EQ(farm.Find(2)->alone_seconds, 100);
}

TEST(SharedFarmTest, HigherPriorityGoesFirst) {
  const SharedFarm farm({Job(1, 0, 100, 1), Job(2, 1, 300, 1), Job(3, -1, 5, 1)}, 1);
  EXPECT_DOUBLE_EQ(SecondsOf(farm, 2), 300);
  EXPECT_DOUBLE_EQ(SecondsOf(farm, 1), 400);
  EXPECT_DOUBLE_EQ(SecondsOf(farm, 3), 405);
}

TEST(SharedFarmTest, WeightsDivideSamples) {
  const SharedFarm farm({Job(1, 0, 100, 1, 3), Job(2, 0, 100, 1, 1)}, 1);
  EXPECT_NEAR(SecondsOf(farm, 1), 100 + 100.0 / 3, 1e-9);
  EXPECT_NEAR(SecondsOf(farm, 2), 200, 1e-9);
}

// Each user gets half, however many jobs they have: shares change as jobs end.
TEST(SharedFarmTest, UsersShareByTime) {
  std::vector<SharedJob> jobs = {Job(1, 0, 100, 1), Job(2, 0, 10, 10), Job(3, 0, 100, 1)};
  jobs[0].user = "anna";
  jobs[1].user = jobs[2].user = "ben";
  const SharedFarm farm(jobs, 1, ShareByTime);
  EXPECT_NEAR(SecondsOf(farm, 1), 200, 1e-9);
  EXPECT_NEAR(SecondsOf(farm, 2), 300, 1);
  EXPECT_NEAR(SecondsOf(farm, 3), 300, 1);
  jobs[0].user_weight = 3;
  EXPECT_NEAR(SecondsOf(SharedFarm(jobs, 1, ShareByTime), 1), 100 / 0.75, 1e-9);
  jobs[0].show = "comet";
  jobs[0].show_weight = 4;
  EXPECT_NEAR(SecondsOf(SharedFarm(jobs, 1, ShareByTime), 1), 100 / 0.8, 1e-9);
}

TEST(SharedFarmTest, UnknownCostsAreThoseOfTheOthers) {
  const SharedFarm farm({Job(1, 0, 100, 2), Job(2, 0, 100, 0)}, 1);
  EXPECT_NEAR(SecondsOf(farm, 2), 400, 1e-9);
  EXPECT_EQ(SharedFarm({Job(1, 0, 100, 0)}, 1).Find(1), nullptr);
  EXPECT_EQ(SharedFarm({Job(1, 0, 100, 1)}, 0).Find(1), nullptr);
}

TEST(SharedFarmTest, BandsNarrowWithWhatIsKnown) {
  SharedJob begun = Job(1, 0, 100, 1), nearly_done = Job(1, 0, 100, 1);
  begun.done_fraction = 0.02;
  nearly_done.done_fraction = 0.98;
  const SharedFarm wide({begun}, 1), narrow({nearly_done}, 1);
  const Estimate a = wide.Find(1)->wall_seconds, b = narrow.Find(1)->wall_seconds;
  EXPECT_LT(a.low, b.low);
  EXPECT_LT(b.low, b.value);
  EXPECT_LT(b.value, b.high);
  EXPECT_LT(b.high, a.high);
}

// The closed form of the same policy, for many jobs and more than are shared.
TEST(SharedFarmTest, AgreesWithWorkAhead) {
  std::mt19937 random(5);
  const auto draw = [&](int values) { return static_cast<int>(random() % values); };
  std::vector<SharedJob> jobs;
  std::vector<WorkLeft> left;
  for (uint64_t id = 1; id <= 300; ++id) {
    jobs.push_back(Job(id, draw(4), 1.0 + draw(1000), 0.25 * (1 + draw(4)), 1 + draw(3)));
    left.push_back(jobs.back().left);
  }
  const SharedFarm farm(jobs, 3);
  const WorkAhead ahead(left);
  double all = 0;
  for (const WorkLeft& job : left) all += job.sample_count * job.cpu_seconds_per_sample / 3;
  for (const SharedJob& job : jobs) {
    const double expected = ahead.CpuSeconds(job.left) / 3;
    EXPECT_NEAR(SecondsOf(farm, job.job_id), expected, 5e-3 * all) << job.job_id;
  }
}

TEST(SharedFarmTest, JobsBeyondTheLimitFollow) {
  std::vector<SharedJob> jobs;
  for (uint64_t id = 1; id <= SharedFarm::kJobsMax + 10; ++id) jobs.push_back(Job(id, 0, 1, 1));
  const SharedFarm farm(jobs, 1);
  EXPECT_NEAR(SecondsOf(farm, SharedFarm::kJobsMax + 10), SharedFarm::kJobsMax + 10.0, 1);
}

}  // namespace
}  // namespace sheaf::coordinator
