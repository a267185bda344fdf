// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Results that others render again: who gets a check, when, and what a comparison shows.
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "coordinator/scheduling/scheduler.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::ElementsAre;

constexpr char kChecksProfile[] = "profile";
constexpr double kChosen = 0, kNotChosen = 0.999;

class SchedulerChecksTest : public ::testing::Test {
 protected:
  SchedulerChecksTest() { AddJob(); }
  // A frame of four tiles of one task each.
  void AddJob() {
    JobSpec job;
    job.job_id = 1;
    job.numeric_profile = kChecksProfile;
    job.partition = {32, 16, 1};
    FrameSpec frame;
    frame.frame_number = 1;
    frame.scene = {Sha256Hex("scene"), 1};
    frame.settings.width_px = frame.settings.height_px = 64;
    frame.settings.window = {0, 0, 64, 64};
    frame.settings.samples = 16;
    frame.frame_digest = Sha256Hex("frame");
    job.frames = {frame};
    scheduler_.AddJob(job);
  }
  std::vector<Lease> Sync(const std::string& id, int wanted, const std::string& identity = "") {
    WorkerReport report;
    report.worker_id = report.host = id;
    report.identity = identity;
    report.numeric_profile = kChecksProfile;
    report.requested_lease_count = wanted;
    for (const Lease& lease : held_[id]) {
      report.leases.push_back({lease.lease_id, LeasePhase::kRendering});
    }
    report.failures = std::move(failures_[id]);
    failures_[id].clear();
    const absl::StatusOr<Scheduler::SynchronizeAnswer> answer =
        scheduler_.Synchronize(report, now_);
    held_[id] = answer.ok() ? answer->leases : std::vector<Lease>();
    return held_[id];
  }
  void Forget(const Lease& lease) {
    std::erase_if(held_[lease.worker_id],
                  [&](const Lease& held) { return held.lease_id == lease.lease_id; });
  }
  // The first result of a task, with the digest of these bytes.
  void Accept(Lease lease, const std::string& bytes, double draw, const ResultCost& cost = {}) {
    Forget(lease);
    scheduler_.Accept(lease.frame, lease.task, lease.lease_id, lease.worker_id, cost, now_);
    scheduler_.ConsiderCheck(lease.frame, lease.task, {lease.identity, bytes}, draw);
    merged_[lease.task.tile] = {lease.identity, bytes};
  }
  // Worker "a" renders tasks that take ten seconds each, and a check of each is chosen.
  void DeliverLongTasks(int count) {
    ResultCost cost;
    cost.cpu_duration = absl::Seconds(10);
    for (const Lease& lease : Sync("a", count)) {
      now_ += absl::Seconds(10);
      Sync("b", 0);
      Accept(lease, "x", kChosen, cost);
    }
  }
  CheckVerdict Compare(Lease lease, const std::string& bytes) {
    Forget(lease);
    return scheduler_.Compare(lease.frame, lease.task, lease.lease_id, lease.worker_id,
                              merged_.at(lease.task.tile), {lease.identity, bytes}, {}, now_);
  }

  const Limits limits_;
  Scheduler scheduler_{limits_, 1000};
  SteadyTime now_;
  std::map<std::string, std::vector<Lease>> held_;
  std::map<std::string, std::vector<LeaseFailure>> failures_;
  std::map<uint32_t, ResultVersion> merged_;  // By tile.
};

TEST_F(SchedulerChecksTest, ChecksGoToAnotherIdentityBeforeNewWork) {
  Sync("b", 0);
  Accept(Sync("a", 1).at(0), "x", kChosen);
  EXPECT_EQ(scheduler_.counters().checks_begun, 1u);
  EXPECT_FALSE(Sync("a", 1).at(0).is_check) << "not its own";
  const Lease cold = Sync("b", 1).at(0);
  EXPECT_FALSE(cold.is_check) << "its scene is not there yet, and there is other work";
  const std::vector<Lease> warm = Sync("b", 2);
  ASSERT_EQ(warm.size(), 2u);
  EXPECT_TRUE(warm[1].is_check);
  EXPECT_EQ(warm[1].task.tile, 0u);
  EXPECT_EQ(Compare(warm[1], "x").kind, CheckVerdict::Kind::kConfirmed);
  EXPECT_EQ(scheduler_.checks().size(), 0u);
  EXPECT_EQ(scheduler_.counters().samples_checked, 32u * 32 * 16);
}

TEST_F(SchedulerChecksTest, OnlyChosenResultsAreChecked) {
  Sync("b", 0);
  Accept(Sync("a", 1).at(0), "x", kNotChosen);
  Accept(Sync("a", 1).at(0), "x", limits_.new_identity_check_fraction - 0.01);
  EXPECT_EQ(scheduler_.checks().size(), 1u);
}

TEST_F(SchedulerChecksTest, FarmsOfOneIdentityCheckNothing) {
  Accept(Sync("a", 1).at(0), "x", kChosen);
  EXPECT_EQ(scheduler_.checks().size(), 0u);
  Sync("a1", 0, "one");
  Accept(Sync("a1", 1, "one").at(0), "x", kNotChosen);
  EXPECT_EQ(scheduler_.checks().size(), 0u);
}

TEST_F(SchedulerChecksTest, WorkersOfOneIdentityDoNotCheckEachOther) {
  Sync("b", 0, "two");
  Accept(Sync("a1", 1, "one").at(0), "x", kChosen);
  for (const Lease& lease : Sync("a2", 4, "one")) EXPECT_FALSE(lease.is_check);
  ASSERT_EQ(scheduler_.checks().size(), 1u);
}

TEST_F(SchedulerChecksTest, RenderedFramesWaitForChecksWhileSomebodyCanDoThem) {
  Sync("b", 0);
  const FrameId frame{1, 1};
  for (const Lease& lease : Sync("a", 4)) Accept(lease, "x", kChosen);
  EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
  std::vector<Lease> checks = Sync("b", 4);
  ASSERT_EQ(checks.size(), 4u);
  for (const Lease& lease : checks) EXPECT_TRUE(lease.is_check);
  for (int i = 0; i < 3; ++i) Compare(checks[static_cast<size_t>(i)], "x");
  EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
  Compare(checks[3], "x");
  EXPECT_FALSE(scheduler_.AwaitsChecks(frame, now_));
  EXPECT_TRUE(scheduler_.Deliver(frame));
}

// b takes the checks, says that it renders them, and delivers nothing.
TEST_F(SchedulerChecksTest, DeliveriesDoNotWaitForHoarders) {
  Sync("b", 0);
  const FrameId frame{1, 1};
  for (const Lease& lease : Sync("a", 4)) Accept(lease, "x", kChosen);
  EXPECT_EQ(Sync("b", 4).size(), 4u);
  const SteadyTime end = now_ + limits_.check_wait_min;
  while (now_ < end) {
    EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
    EXPECT_EQ(scheduler_.WaitingReason(scheduler_.jobs().at(1)),
              "waits for checks: other workers render 4 results again, to compare");
    now_ += absl::Seconds(1);
    Sync("b", 4);
    Sync("a", 0);
  }
  EXPECT_FALSE(scheduler_.AwaitsChecks(frame, now_));
  EXPECT_EQ(scheduler_.WhyAwaitsChecks(frame), "");
  EXPECT_TRUE(scheduler_.Deliver(frame));
  EXPECT_EQ(scheduler_.counters().checks_dropped, 4u);
  EXPECT_EQ(scheduler_.leases().size(), 0u);
}

// Long tasks do not give more time to workers that have delivered nothing.
TEST_F(SchedulerChecksTest, DeliveriesOfLongTasksDoNotWaitForHoarders) {
  Sync("b", 0);
  const FrameId frame{1, 1};
  DeliverLongTasks(4);
  EXPECT_EQ(Sync("b", 4).size(), 4u);
  EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
  now_ += limits_.check_wait_min;
  Sync("b", 4);
  EXPECT_FALSE(scheduler_.AwaitsChecks(frame, now_));
}

TEST_F(SchedulerChecksTest, LongTasksOfProvenWorkersHaveTheirTime) {
  Accept(Sync("b", 1).at(0), "x", kNotChosen);
  const FrameId frame{1, 1};
  DeliverLongTasks(3);
  EXPECT_EQ(Sync("b", 4).size(), 3u);
  EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
  now_ += limits_.check_wait_min + absl::Seconds(1);
  Sync("b", 4);
  EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
}

// It has delivered results, reports that it renders, and no other worker may do its checks: then it
// costs at most what a slow machine may take.
TEST_F(SchedulerChecksTest, AProvenHoarderCostsFourTimesACheck) {
  ResultCost cost;
  cost.cpu_duration = absl::Seconds(10);
  Accept(Sync("b", 1).at(0), "x", kNotChosen, cost);
  DeliverLongTasks(3);
  ASSERT_EQ(Sync("b", 4).size(), 3u);
  const SteadyTime begin = now_;
  while (scheduler_.AwaitsChecks({1, 1}, now_)) {
    now_ += absl::Seconds(1);
    Sync("b", 4);
    Sync("a", 0);
  }
  EXPECT_GE(now_ - begin, absl::Seconds(39));
  EXPECT_LE(now_ - begin, absl::Seconds(41));
}

// The same beside a third worker: the checks are hedged at once.
TEST_F(SchedulerChecksTest, AProvenHoarderBesideAnIdleWorkerCostsNothing) {
  Accept(Sync("c", 1).at(0), "x", kNotChosen);
  Accept(Sync("b", 1).at(0), "x", kNotChosen);
  for (const Lease& lease : Sync("a", 2)) Accept(lease, "x", kChosen);
  ASSERT_EQ(Sync("b", 2).size(), 2u);
  EXPECT_TRUE(scheduler_.AwaitsChecks({1, 1}, now_));
  for (int i = 0; i < 2; ++i) {
    const std::vector<Lease> hedge = Sync("c", 1);
    ASSERT_EQ(hedge.size(), 1u);
    EXPECT_EQ(Compare(hedge[0], "x").kind, CheckVerdict::Kind::kConfirmed);
  }
  EXPECT_FALSE(scheduler_.AwaitsChecks({1, 1}, now_));
}

TEST_F(SchedulerChecksTest, EachCheckThatComesProlongsTheWait) {
  Sync("b", 0);
  const FrameId frame{1, 1};
  for (const Lease& lease : Sync("a", 4)) Accept(lease, "x", kChosen);
  const std::vector<Lease> checks = Sync("b", 4);
  EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
  for (size_t i = 0; i < 3; ++i) {
    now_ += limits_.check_wait_min - absl::Seconds(1);
    Compare(checks[i], "x");
    EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
  }
}

TEST_F(SchedulerChecksTest, ChecksGoToProvenWorkersWhereThereAreSome) {
  const FrameId frame{1, 1};
  Accept(Sync("c", 1).at(0), "x", kNotChosen);
  Sync("b", 0);
  for (const Lease& lease : Sync("a", 3)) Accept(lease, "x", kChosen);
  EXPECT_TRUE(Sync("b", 4).empty()) << "it has delivered nothing, and c has";
  EXPECT_EQ(Sync("c", 4).size(), 3u);
  EXPECT_TRUE(scheduler_.AwaitsChecks(frame, now_));
}

// A frozen worker had delivered results before.
TEST_F(SchedulerChecksTest, IdleWorkersHedgeChecks) {
  Accept(Sync("b", 1).at(0), "x", kNotChosen);
  Accept(Sync("c", 1).at(0), "x", kNotChosen);
  Accept(Sync("a", 1).at(0), "x", kChosen);
  Accept(Sync("a", 1).at(0), "x", kNotChosen);
  ASSERT_EQ(Sync("b", 1).size(), 1u);
  const std::vector<Lease> hedge = Sync("c", 1);
  ASSERT_EQ(hedge.size(), 1u);
  EXPECT_TRUE(hedge[0].is_check);
  EXPECT_EQ(Compare(hedge[0], "x").kind, CheckVerdict::Kind::kConfirmed);
  EXPECT_EQ(scheduler_.leases().size(), 0u);
}

TEST_F(SchedulerChecksTest, NobodyWaitsForLostWorkers) {
  Sync("b", 0);
  for (const Lease& lease : Sync("a", 4)) Accept(lease, "x", kChosen);
  EXPECT_TRUE(scheduler_.AwaitsChecks({1, 1}, now_));
  now_ += limits_.lease_duration + absl::Seconds(1);
  Sync("a", 0);
  EXPECT_FALSE(scheduler_.AwaitsChecks({1, 1}, now_));
}

TEST_F(SchedulerChecksTest, AThirdIdentityDecides) {
  for (const bool first_lies : {true, false}) {
    scheduler_.EndJob(1, JobPhase::kCancelled, "");
    scheduler_.RemoveJob(1);
    AddJob();
    held_.clear();
    Sync("b", 0);
    Sync("c", 0);
    for (const Lease& lease : Sync("a", 4)) {
      Accept(lease, "x", lease.task.tile == 2 ? kChosen : kNotChosen);
    }
    const Lease check = Sync("b", 1).at(0);
    ASSERT_TRUE(check.is_check);
    EXPECT_EQ(Compare(check, "y").kind, CheckVerdict::Kind::kOpen);
    EXPECT_TRUE(scheduler_.checks().HasDispute({1, 1}));
    EXPECT_TRUE(Sync("b", 1).empty()) << "it has had its say";
    const Lease decision = Sync("c", 1).at(0);
    EXPECT_EQ(decision.task, check.task);
    const CheckVerdict verdict = Compare(decision, first_lies ? "y" : "x");
    EXPECT_EQ(verdict.kind, CheckVerdict::Kind::kDecided);
    EXPECT_THAT(verdict.liars, ElementsAre(first_lies ? "a" : "b"));
  }
}

TEST_F(SchedulerChecksTest, FailedChecksGoToOthersAndHarmNoJob) {
  Sync("b", 0);
  Sync("c", 0);
  for (const Lease& lease : Sync("a", 4)) {
    Accept(lease, "x", lease.task.tile == 0 ? kChosen : kNotChosen);
  }
  const Lease check = Sync("b", 1).at(0);
  Forget(check);
  failures_["b"].push_back({check.lease_id, FailureKind::kScene, "no"});
  EXPECT_TRUE(Sync("b", 1).empty());
  EXPECT_EQ(scheduler_.jobs().at(1).phase, JobPhase::kLive);
  EXPECT_TRUE(Sync("c", 1).at(0).is_check);
}

TEST_F(SchedulerChecksTest, LostPartsAreRenderedAnewWithoutTheirCheck) {
  Sync("b", 0);
  const Lease lease = Sync("a", 1).at(0);
  Accept(lease, "x", kChosen);
  scheduler_.Revoke({1, 1}, lease.task);
  EXPECT_EQ(scheduler_.checks().size(), 0u);
}

}  // namespace
}  // namespace sheaf::coordinator
