// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/scheduler.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "coordinator/scheduling/tests/scheduler_fixture.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;
using Found = Scheduler::FoundTask::Kind;

TEST_F(SchedulerTest, SingleWorkerFinishesAJob) {
  const uint64_t job = AddJob();
  int results = 0;
  bool rendered = false;
  while (!Sync("a", 2).empty()) {
    const Lease lease = held_["a"][0];
    rendered = Accept(lease);
    ++results;
  }
  EXPECT_TRUE(rendered);
  EXPECT_EQ(results, 4 * 4);
  EXPECT_TRUE(scheduler_.Deliver({job, 1}));
  EXPECT_EQ(Job(job).phase, JobPhase::kSucceeded);
  EXPECT_EQ(scheduler_.TakeEndedJobs(), std::vector<uint64_t>{job});
  EXPECT_EQ(scheduler_.leases().size(), 0u);
}

// Between rounds nothing can be leased: who asks again late is idle for that long.
TEST_F(SchedulerTest, IdleWorkersPollSoonForTheNextRound) {
  const uint64_t job = AddJob(1, 0, {.target_error = 0.1});
  EXPECT_FALSE(Sync("a", 100).empty());
  EXPECT_EQ(next_synchronize_, limits_.heartbeat_interval_max);
  while (!Sync("a", 2).empty()) Accept(held_["a"][0]);
  EXPECT_EQ(next_synchronize_, limits_.round_interval_min);
  draining_ = true;
  Sync("a", 2);
  EXPECT_EQ(next_synchronize_, limits_.idle_interval_min);
  draining_ = false;
  scheduler_.Pause(job, now_);
  Sync("a", 2);
  EXPECT_EQ(next_synchronize_, limits_.idle_interval_min);
  scheduler_.Resume(job, now_);
  scheduler_.Deliver({job, 1});
  Sync("a", 2);
  EXPECT_EQ(next_synchronize_, limits_.idle_interval_min);
}

TEST_F(SchedulerTest, LostRepliesAreHarmless) {
  AddJob();
  const std::vector<Lease> first = Sync("a", 2);
  held_["a"].clear();  // The reply never came.
  const std::vector<Lease> second = Sync("a", 2);
  ASSERT_EQ(second.size(), 2u);
  EXPECT_EQ(first[0].lease_id, second[0].lease_id);
  EXPECT_EQ(first[1].lease_id, second[1].lease_id);
}

TEST_F(SchedulerTest, SilentWorkersLoseLeasesButLateResultsCount) {
  AddJob();
  const Lease lease = Sync("a", 1)[0];
  now_ += limits_.lease_duration + absl::Seconds(1);
  const Lease again = Sync("b", 1)[0];
  EXPECT_EQ(again.task, lease.task);
  EXPECT_EQ(again.attempt, 1);
  EXPECT_NE(again.lease_id, lease.lease_id);
  EXPECT_EQ(scheduler_.counters().leases_expired, 1u);
  Accept(lease);
  EXPECT_EQ(scheduler_.counters().results_late, 1u);
  EXPECT_EQ(Find(again).kind, Found::kCovered);
  // The newer lease is cancelled: it is not in the next answer.
  for (const Lease& held : Sync("b", 1)) EXPECT_NE(held.lease_id, again.lease_id);
}

TEST_F(SchedulerTest, IdleWorkersHedgeOthersLeases) {
  AddJob();
  const std::vector<Lease> all = Sync("a", 16);
  ASSERT_EQ(all.size(), 16u);
  EXPECT_EQ(Sync("a", 17).size(), 16u);
  const Lease hedge = Sync("b", 1)[0];
  EXPECT_EQ(scheduler_.counters().leases_hedged, 1u);
  EXPECT_EQ(Sync("b", 4).size(), 1u);  // One at a time.
  const Lease other = Sync("c", 1)[0];
  EXPECT_NE(hedge.task, other.task);
  Accept(hedge);
  EXPECT_EQ(Sync("a", 16).size(), 15u);
  EXPECT_EQ(scheduler_.counters().leases_cancelled, 1u);
}

TEST_F(SchedulerTest, HedgesStartWithUnstartedLeases) {
  AddJob();
  Sync("a", 16);
  Sync("a", 16);  // Now it reports the first as being rendered.
  EXPECT_NE(Sync("b", 1)[0].task, held_["a"][0].task);
}

TEST_F(SchedulerTest, PriorityOrdersJobsAndEqualsShare) {
  const uint64_t low = AddJob(1, 0), high = AddJob(1, 5);
  for (const Lease& lease : Sync("a", 16)) EXPECT_EQ(lease.frame.job_id, high);
  EXPECT_EQ(Sync("b", 1)[0].frame.job_id, low);
  const uint64_t equal = AddJob(1, 0);
  // Shares are exact where the worker has the scenes of both.
  for (const uint64_t id : {low, equal}) {
    warm_.push_back(Sha256Hex(absl::StrCat("scene", id, "-1")));
  }
  std::map<uint64_t, int> counts;
  for (const Lease& lease : Sync("c", 10)) ++counts[lease.frame.job_id];
  EXPECT_EQ(counts[low], 5);
  EXPECT_EQ(counts[equal], 5);
}

TEST_F(SchedulerTest, ColdWorkersSpreadAndWarmWorkersStay) {
  AddJob(3);
  EXPECT_EQ(Sync("a", 1)[0].frame.frame_number, 1);
  EXPECT_EQ(Sync("b", 1)[0].frame.frame_number, 2);
  EXPECT_EQ(Sync("a", 2)[1].frame.frame_number, 1);
  warm_ = {Sha256Hex("scene1-3")};
  EXPECT_EQ(Sync("c", 1)[0].frame.frame_number, 3);
}

TEST_F(SchedulerTest, OtherProfilesGetNoLeases) {
  const uint64_t job = AddJob();
  WorkerReport report;
  report.worker_id = "a";
  report.numeric_profile = "other";
  report.requested_lease_count = 2;
  const auto answer = scheduler_.Synchronize(report, now_);
  ASSERT_TRUE(answer.ok());
  EXPECT_TRUE(answer->leases.empty());
  EXPECT_THAT(scheduler_.WaitingReason(Job(job)), HasSubstr("other"));
}

TEST_F(SchedulerTest, ReleasedLeasesAreNoFailures) {
  AddJob();
  Sync("b", 0);
  for (int i = 0; i < 50; ++i) {
    Fail(Sync("a", 1)[0], FailureKind::kReleased);
  }
  EXPECT_EQ(Job(1).phase, JobPhase::kLive);
  EXPECT_EQ(Sync("a", 1)[0].task, (Task{0, {0, 16}}));
}

TEST_F(SchedulerTest, DrainingWorkersKeepTheirLeasesOnly) {
  AddJob();
  Sync("a", 2);
  draining_ = true;
  EXPECT_EQ(Sync("a", 4).size(), 2u);
  held_["a"].clear();  // It lets go of both.
  EXPECT_TRUE(Sync("a", 4).empty());
  draining_ = false;
  EXPECT_EQ(Sync("b", 1)[0].attempt, 1);
}

TEST_F(SchedulerTest, FailedTasksGoToOtherWorkers) {
  AddJob();
  Sync("b", 0);
  const Lease lease = Sync("a", 1)[0];
  Fail(lease, FailureKind::kInternal);
  EXPECT_NE(Sync("a", 1)[0].task, lease.task);
  EXPECT_EQ(Sync("b", 1)[0].task, lease.task);
}

TEST_F(SchedulerTest, ThreeWorkersPoisonATask) {
  const uint64_t job = AddJob();
  Sync("d", 0);
  for (const std::string id : {"a", "b", "c"}) {
    const Lease lease = Sync(id, 1)[0];
    EXPECT_EQ(lease.task, (Task{0, {0, 16}}));
    EXPECT_EQ(Job(job).phase, JobPhase::kLive);
    Fail(lease, FailureKind::kInternal, "segmentation fault");
    Sync(id, 0);
  }
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 1u);
  EXPECT_EQ(Job(job).phase, JobPhase::kLive) << "the rest of the frame continues";
  while (!Sync("d", 1).empty()) Accept(held_["d"][0]);
  EXPECT_EQ(Job(job).frames[0].sample_count_done, 64u * 64 * 64 - 32 * 32 * 16);
  EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
  EXPECT_EQ(Job(job).frames[0].phase, FrameRecord::Phase::kIncomplete);
  EXPECT_THAT(Job(job).failure, HasSubstr("1 of 1 frame is incomplete: frame 1: 1 task"));
  EXPECT_THAT(Job(job).failure, HasSubstr("a by a crash, b by a crash, c by a crash"));
  EXPECT_THAT(Job(job).failure, HasSubstr("[0, 32) x [0, 32)"));
  EXPECT_THAT(Job(job).failure, HasSubstr("segmentation fault"));
  EXPECT_THAT(Job(job).failure, HasSubstr(absl::StrCat("sheaf bundle jobs/", job)));
  EXPECT_EQ(scheduler_.leases().size(), 0u);
}

TEST_F(SchedulerTest, WorkerLossesAreCountedAndHarmNobody) {
  const uint64_t job = AddJob();
  for (int i = 0; i < 20; ++i) {
    Sync("w", 1);
    Sync("w", 1);  // Reports that it renders.
    now_ += limits_.lease_duration + absl::Seconds(1);
    scheduler_.Tick(now_);
    held_["w"].clear();
  }
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
  EXPECT_EQ(scheduler_.counters().failures[static_cast<size_t>(FailureKind::kLost)], 20u);
  ASSERT_EQ(Job(job).frames[0].failures.size(), 1u);
  const TaskTrouble& trouble = Job(job).frames[0].failures.begin()->second.trouble;
  ASSERT_EQ(trouble.failures.size(), 1u);
  EXPECT_EQ(trouble.failures[0].count, 20);
  EXPECT_FALSE(Sync("w", 1).empty()) << "who vanished may come back to the same task";
}

// A coordinator that is stopped for hours, or whose clock leaps, finds everybody silent at once.
TEST_F(SchedulerTest, ForgottenWorkersReturnTheirLeases) {
  const uint64_t job = AddJob();
  const size_t held = Sync("a", 3).size();
  ASSERT_EQ(scheduler_.leases().size(), held);
  now_ += limits_.lost_worker_kept + limits_.lease_duration + absl::Seconds(1);
  EXPECT_TRUE(scheduler_.Tick(now_));
  EXPECT_EQ(scheduler_.leases().size(), 0u);
  EXPECT_TRUE(scheduler_.workers().workers().empty());
  EXPECT_EQ(scheduler_.counters().workers_lost, 1u);
  EXPECT_EQ(Sync("b", 3).size(), held);  // The same work, for another worker.
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
  // The work that the forgotten worker finished meanwhile still counts.
  EXPECT_EQ(Find(held_["a"].front()).kind, Found::kWanted);
  Accept(held_["a"].front());
  now_ += limits_.lost_worker_kept + limits_.lease_duration + absl::Seconds(1);
  EXPECT_FALSE(Sync("a", 1).empty());  // Which finds b silent.
  EXPECT_EQ(scheduler_.workers().workers().size(), 1u);
}

TEST_F(SchedulerTest, SceneErrorsNeedASecondWorkerIfAny) {
  const uint64_t job = AddJob();
  Sync("b", 0);
  Fail(Sync("a", 1)[0], FailureKind::kScene, "x.pbrt:1:1: bad");
  EXPECT_TRUE(Sync("a", 1).empty());  // It gets no other task of that frame.
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
  Fail(Sync("b", 1)[0], FailureKind::kScene, "x.pbrt:1:1: bad");
  Sync("b", 1);
  EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
  EXPECT_THAT(Job(job).failure, HasSubstr("x.pbrt:1:1: bad"));
}

TEST_F(SchedulerTest, SceneErrorsStandWhenTheOtherWorkerIsLost) {
  const uint64_t job = AddJob();
  Sync("b", 0);
  Fail(Sync("a", 1)[0], FailureKind::kScene);
  Sync("a", 1);
  ASSERT_EQ(Job(job).phase, JobPhase::kLive);
  now_ += limits_.lease_duration - absl::Seconds(1);
  Sync("a", 1);
  now_ += absl::Seconds(2);
  scheduler_.Tick(now_);
  EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
}

TEST_F(SchedulerTest, InfrastructureFailuresDelayTheWorkerThenSetTasksAside) {
  const uint64_t job = AddJob();
  Fail(Sync("a", 1)[0], FailureKind::kInfrastructure, "disk full");
  EXPECT_TRUE(Sync("a", 1).empty());
  now_ += limits_.retry_delay_initial;
  ASSERT_FALSE(Sync("a", 1).empty());
  for (int i = 1; Job(job).phase == JobPhase::kLive && i < 600; ++i) {
    if (!held_["a"].empty()) Fail(held_["a"][0], FailureKind::kInfrastructure, "disk full");
    Sync("a", 1);
    now_ += limits_.retry_delay_max;
    Sync("a", 1);
  }
  EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
  EXPECT_THAT(Job(job).failure, HasSubstr("disk full"));
}

TEST_F(SchedulerTest, LastFailuresAreKept) {
  const uint64_t job = AddJob();
  Fail(Sync("a", 1)[0], FailureKind::kReleased);
  const Lease lease = Sync("a", 1)[0];
  Fail(lease, FailureKind::kInfrastructure, "disk");
  Sync("a", 0);
  ASSERT_EQ(Job(job).failures.count, 1) << "a returned lease is not a failure";
  const FailureRecord& kept = Job(job).failures.last.back();
  EXPECT_EQ(kept.frame_number, 1);
  EXPECT_EQ(kept.tile, lease.tile_rect);
  EXPECT_EQ(kept.block, lease.task.block);
  EXPECT_EQ(kept.worker_id, "a");
  EXPECT_EQ(kept.message, "disk");
  const absl::Time stamp = absl::FromUnixSeconds(1'700'000'000);
  EXPECT_EQ(scheduler_.TakeFailureJobs(stamp), std::set<uint64_t>{job});
  EXPECT_TRUE(scheduler_.TakeFailureJobs(stamp + absl::Hours(1)).empty());
  EXPECT_EQ(Job(job).failures.last.back().time, stamp);
  while (Job(job).phase == JobPhase::kLive) {
    now_ += absl::Seconds(20);
    const std::vector<Lease> held = Sync("a", 4);
    for (const Lease& one : held) Fail(one, FailureKind::kInfrastructure, "disk again");
  }
  EXPECT_EQ(Job(job).failures.last.size(), static_cast<size_t>(limits_.failures_kept_max));
  EXPECT_GT(Job(job).failures.count, limits_.failures_kept_max);
  EXPECT_EQ(Job(job).failures.last.front().message, "disk again");
}

TEST_F(SchedulerTest, MemoryFailuresLeaveTheFrameToOthers) {
  AddJob();
  Sync("b", 0);
  Fail(Sync("a", 1)[0], FailureKind::kMemory);
  EXPECT_TRUE(Sync("a", 1).empty());
  EXPECT_FALSE(Sync("b", 1).empty());
}

TEST_F(SchedulerTest, JobsBeyondLimitsAreRefused) {
  JobSpec job;
  job.job_id = 1;
  EXPECT_EQ(scheduler_.CheckJob(job).code(), absl::StatusCode::kInvalidArgument);
  job.frames = {Frame(1, "s", 1), Frame(1, "s", 1)};
  EXPECT_THAT(std::string(scheduler_.CheckJob(job).message()), HasSubstr("repeated"));
  job.frames = {Frame(1, "s", 1)};
  EXPECT_TRUE(scheduler_.CheckJob(job).ok());
  job.frames[0].settings.window.x1 = 65;
  EXPECT_THAT(std::string(scheduler_.CheckJob(job).message()), HasSubstr("window"));
  job.frames = {Frame(1, "s", 1)};
  job.frames[0].settings.width_px = job.frames[0].settings.height_px = 16000;
  job.frames[0].settings.window = {0, 0, 16000, 16000};
  job.partition.tile_size_px = 1;
  EXPECT_THAT(std::string(scheduler_.CheckJob(job).message()), HasSubstr("tiles"));
}

TEST_F(SchedulerTest, LeasesGrowWithSpeedAndShrinkAtTheEnd) {
  JobSpec job;
  job.job_id = 1;
  job.numeric_profile = kProfile;
  job.partition = {32, 16, 0};
  job.frames = {Frame(1, "s", 1)};
  job.frames[0].settings.samples = 4096;
  scheduler_.AddJob(job);
  std::vector<uint64_t> counts;
  while (!Sync("a", 1).empty()) {
    const Lease lease = held_["a"][0];
    counts.push_back(lease.task.block.count);
    Accept(lease);
  }
  EXPECT_EQ(counts.front(), 16u);
  EXPECT_GE(*std::max_element(counts.begin(), counts.end()), 512u);
  EXPECT_LE(counts.back(), 512u);
}

// Four tiles of camera samples, then light passes, which have a limit of their own.
TEST_F(SchedulerTest, LightPassesAreLeasedBesideTiles) {
  JobSpec job;
  job.job_id = 1;
  job.numeric_profile = kProfile;
  job.partition = {32, 16, 4};
  job.frames.push_back(Frame(1, "scene", 1));
  job.frames[0].settings.techniques = TechniqueSet::kCameraAndLight;
  ASSERT_TRUE(scheduler_.CheckJob(job).ok());
  scheduler_.AddJob(job);
  std::vector<Lease> leases = Sync("w", 6);
  ASSERT_EQ(leases.size(), 6u);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(leases[i].kind, TaskKind::kCamera);
  EXPECT_EQ(leases[4].kind, TaskKind::kLight);
  EXPECT_EQ(leases[4].tile_rect, (PixelRect{0, 0, 64, 64}));
  EXPECT_EQ(leases[4].task.block, (SampleBlock{0, 16}));
  EXPECT_TRUE(leases[4].cells.All());
  EXPECT_EQ(SampleCountTotal(Job(1).frames[0]), 2u * 64 * 64 * 64);
  std::vector<SampleBlock> passes;
  while (!held_["w"].empty()) {
    const Lease lease = held_["w"].front();
    if (lease.kind == TaskKind::kLight) passes.push_back(lease.task.block);
    const std::string digest = scheduler_.FindFrame(lease.frame)->Spec().frame_digest;
    const auto found = scheduler_.FindTask(digest, lease.tile_rect, lease.task.block, lease.cells,
                                           lease.lease_id, lease.kind);
    ASSERT_EQ(found.kind, Scheduler::FoundTask::Kind::kWanted);
    EXPECT_EQ(found.task, lease.task);
    std::erase_if(held_["w"], [&](const Lease& l) { return l.lease_id == lease.lease_id; });
    scheduler_.Accept(lease.frame, lease.task, lease.lease_id, "w", {1, 0, absl::Milliseconds(1)},
                      now_);
    Sync("w", 6);
  }
  EXPECT_EQ(passes, (std::vector<SampleBlock>{{0, 16}, {16, 16}, {32, 16}, {48, 16}}));
  EXPECT_EQ(Job(1).frames[0].phase, FrameRecord::Phase::kRendered);
}

// A pass is as large as the frame: where the coordinator chooses, tasks of light passes have few.
TEST_F(SchedulerTest, UnknownWorkersGetOneLightPass) {
  JobSpec job;
  job.job_id = 1;
  job.numeric_profile = kProfile;
  job.partition = {64, 16, 0};
  job.frames.push_back(Frame(1, "scene", 1));
  job.frames[0].settings.techniques = TechniqueSet::kCameraAndLight;
  scheduler_.AddJob(job);
  const std::vector<Lease> leases = Sync("w", 2);
  ASSERT_EQ(leases.size(), 2u);
  EXPECT_EQ(leases[0].task.block, (SampleBlock{0, 16}));
  EXPECT_EQ(leases[1].kind, TaskKind::kLight);
  EXPECT_EQ(leases[1].task.block, (SampleBlock{0, 1}));
  for (const Lease& lease : leases) Fail(lease, FailureKind::kInfrastructure);
  Sync("w", 0);
  const FailureLog& log = Job(1).failures;
  ASSERT_EQ(log.last.size(), 2u);
  EXPECT_EQ(log.last[0].task_kind, TaskKind::kCamera);
  EXPECT_EQ(log.last[1].task_kind, TaskKind::kLight);
}

}  // namespace
}  // namespace sheaf::coordinator
