// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Which work workers get, by the scenes that they have (placement.h).
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "coordinator/scheduling/tests/scheduler_fixture.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class PlacementTest : public SchedulerTest {
 protected:
  // A job with frame_count frames of one scene.
  uint64_t AddJobOf(const std::string& scene, int frame_count = 1, int32_t priority = 0,
                    int32_t edge_px = 64) {
    JobSpec job;
    job.job_id = ++last_job_id_;
    job.priority = priority;
    job.numeric_profile = kProfile;
    job.partition = {32, 16, 1};
    for (int i = 1; i <= frame_count; ++i) {
      job.frames.push_back(Frame(i, scene, job.job_id * 1000 + static_cast<uint64_t>(i)));
      FrameSettings& settings = job.frames.back().settings;
      settings.width_px = settings.height_px = edge_px;
      settings.window = {0, 0, edge_px, edge_px};
    }
    EXPECT_TRUE(scheduler_.CheckJob(job).ok());
    scheduler_.AddJob(job);
    return job.job_id;
  }
  // The lease took CPU time for as long as it was held.
  void Finish(Lease lease) {
    std::erase_if(held_[lease.worker_id],
                  [&](const Lease& l) { return l.lease_id == lease.lease_id; });
    scheduler_.Accept(lease.frame, lease.task, lease.lease_id, lease.worker_id,
                      {1, 0, now_ - lease.grant_time}, now_);
  }
  // The worker finishes what it holds and gets a lease; returns its job.
  uint64_t Next(const std::string& id, const std::vector<std::string>& warm) {
    warm_.clear();
    for (const std::string& scene : warm) warm_.push_back(Sha256Hex(scene));
    while (!held_[id].empty()) Finish(held_[id][0]);
    const std::vector<Lease>& held = Sync(id, 1);
    return held.empty() ? 0 : held[0].frame.job_id;
  }
};

TEST_F(PlacementTest, WarmWorkOfAnotherJobGoesFirst) {
  const uint64_t x = AddJobOf("x", 20), y = AddJobOf("y", 20);
  EXPECT_EQ(Next("a", {}), x);
  EXPECT_EQ(Next("b", {}), y);
  now_ += absl::Seconds(1);
  EXPECT_EQ(Next("a", {"x"}), x);
  const uint64_t x2 = AddJobOf("x", 20);
  std::map<uint64_t, int> counts;
  for (int i = 0; i < 8; ++i) {
    now_ += absl::Seconds(1);
    ++counts[Next("a", {"x"})];
  }
  EXPECT_EQ(counts[y], 0);
  EXPECT_EQ(counts[x] + counts[x2], 8);
  EXPECT_GE(counts[x2], 4);
  EXPECT_EQ(scheduler_.counters().leases_cold, 2u);
  EXPECT_EQ(scheduler_.workers().workers().at("a").lease_cold_count, 1u);
  EXPECT_EQ(scheduler_.workers().workers().at("a").lease_granted_count, 10u);
}

TEST_F(PlacementTest, ColderJobsWaitABoundedTime) {
  const uint64_t x = AddJobOf("x", 200), y = AddJobOf("y", 200);
  ASSERT_EQ(Next("a", {}), x);
  ASSERT_EQ(Next("b", {}), y);  // ... and is busy from now on.
  while (Next("a", {"x"}) == x) {
    now_ += absl::Seconds(1);
    ASSERT_LE(now_, SteadyTime() + limits_.warm_wait_max + limits_.warm_stay_min);
    warm_ = {Sha256Hex("y")};
    Sync("b", 1);  // Not lost.
  }
  EXPECT_EQ(held_["a"][0].frame.job_id, y);
  EXPECT_GE(now_, SteadyTime() + limits_.warm_stay_min);
  EXPECT_EQ(Job(y).passed_time, SteadyTime::InfiniteFuture());
  // Now it stays with it, although the other job is warm elsewhere.
  EXPECT_EQ(Next("a", {"x", "y"}), y);
}

TEST_F(PlacementTest, ANewSceneGetsAWorkerThatHasStayed) {
  const uint64_t x = AddJobOf("x", 200);
  EXPECT_EQ(Next("a", {}), x);
  const uint64_t y = AddJobOf("y");
  now_ += limits_.warm_stay_min / 2;
  EXPECT_EQ(Next("a", {"x"}), x);
  EXPECT_EQ(Next("a", {"x"}), x);
  now_ += limits_.warm_stay_min / 2;
  EXPECT_EQ(Next("a", {"x"}), y);
}

TEST_F(PlacementTest, PriorityGoesBeforeWarmth) {
  AddJobOf("x", 20);
  EXPECT_EQ(Next("a", {}), 1u);
  const uint64_t high = AddJobOf("y", 1, 3);
  EXPECT_EQ(Next("a", {"x"}), high);
}

TEST_F(PlacementTest, ColdWorkersGoWhereFewAreWarm) {
  const uint64_t x = AddJobOf("x", 1, 0, 256), y = AddJobOf("y", 1, 0, 256);
  std::map<uint64_t, int> counts;
  for (const std::string id : {"a", "b", "c", "d", "e", "f"}) ++counts[Next(id, {})];
  EXPECT_EQ(counts[x], 3);
  EXPECT_EQ(counts[y], 3);
}

// If no further frame may be opened, the jobs that wait for that must not hide those that continue.
TEST_F(PlacementTest, JobsThatCannotOpenAFrameLeaveTheOthersTheirTurn) {
  const uint64_t big = AddJobOf("big", 1, 0, 5792);  // All pixels that may be open.
  EXPECT_EQ(Next("a", {}), big);
  for (int i = 0; i < limits_.job_scan_max + 10; ++i) AddJobOf("s" + std::to_string(i), 1, 0, 128);
  EXPECT_EQ(Next("b", {}), big);
  EXPECT_EQ(Next("a", {}), big);
}

}  // namespace
}  // namespace sheaf::coordinator
