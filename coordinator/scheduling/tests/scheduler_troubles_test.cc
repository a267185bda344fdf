// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Failure classes: who gets a failed task again, what is set aside, and what people do about it.
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/tests/scheduler_fixture.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

class TroublesTest : public SchedulerTest {
 protected:
  // Has each of the workers fail the task that is leased first.
  void FailFirstTask(const std::vector<std::string>& workers, FailureKind kind) {
    for (const std::string& id : workers) Sync(id, 0);
    for (const std::string& id : workers) {
      Lease lease = Sync(id, 1).at(0);
      ASSERT_EQ(lease.task, (Task{0, {0, 16}}));
      Fail(lease, kind);
      Sync(id, 0);
    }
  }
  void RenderAllBy(const std::string& id) {
    while (!Sync(id, 1).empty()) Accept(held_[id][0]);
  }
  // The scheduler after a restart, with the durable state of one job.
  std::vector<TaskTrouble> Durable() {
    std::vector<TaskTrouble> troubles;
    for (const auto& [id, trouble] : scheduler_.TakeTroubles()) {
      if (!trouble.Empty()) troubles.push_back(trouble);
    }
    return troubles;
  }
  const FrameRecord& FrameOf(uint64_t job) { return Job(job).frames[0]; }
};

TEST_F(TroublesTest, WhoFailedATaskNeverGetsItAgain) {
  for (const FailureKind kind :
       {FailureKind::kInternal, FailureKind::kMemory, FailureKind::kInvalid}) {
    SCOPED_TRACE(FailureKindName(kind));
    const uint64_t job = AddJob();
    Fail(Sync("a", 1).at(0), kind);
    RenderAllBy("a");
    EXPECT_EQ(Job(job).phase, JobPhase::kLive);
    EXPECT_EQ(FrameOf(job).sample_count_done, 64u * 64 * 64 - 32 * 32 * 16);
    EXPECT_THAT(scheduler_.WaitingReason(Job(job)),
                HasSubstr(absl::StrCat("waiting for another worker: a failed this task by ",
                                       FailureKindText(kind), " (frame 1, tile [0, 32)")));
    EXPECT_EQ(Sync("b", 1).at(0).task, (Task{0, {0, 16}}));
    EXPECT_EQ(scheduler_.WaitingReason(Job(job)), "");
    EXPECT_TRUE(Accept(held_["b"][0]));
    scheduler_.Deliver({job, 1});
    now_ += limits_.sick_window + absl::Seconds(1);
    Sync("b", 0);
    now_ += limits_.lease_duration / 2;  // Only a is there for the next class.
    Sync("a", 0);
    now_ += limits_.lease_duration / 2 + absl::Seconds(1);
    Sync("a", 0);
  }
}

TEST_F(TroublesTest, InfrastructureFailuresGoToOthersFirst) {
  AddJob();
  Sync("b", 0);
  Fail(Sync("a", 1).at(0), FailureKind::kInfrastructure, "no route");
  Sync("a", 0);
  now_ += limits_.retry_delay_max;
  Sync("b", 0);
  EXPECT_NE(Sync("a", 1).at(0).task, (Task{0, {0, 16}})) << "b can do it";
  scheduler_.Quarantine("b", "gone");
  EXPECT_EQ(Sync("a", 2).at(1).task, (Task{0, {0, 16}})) << "such trouble passes";
}

TEST_F(TroublesTest, LeasesThatFailTogetherDelayTheirWorkerOnce) {
  AddJob();
  Sync("a", 3);
  ASSERT_EQ(held_["a"].size(), 3u);
  const std::vector<Lease> of_one_load = held_["a"];
  for (const Lease& lease : of_one_load) Fail(lease, FailureKind::kInfrastructure, "no route");
  EXPECT_TRUE(Sync("a", 3).empty());
  now_ += limits_.retry_delay_initial;
  EXPECT_FALSE(Sync("a", 3).empty()) << "one load, one delay";
}

TEST_F(TroublesTest, ASceneThatACacheCannotHoldDelaysItsJobAlone) {
  const uint64_t large = AddJob(), small = AddJob();
  const auto refuse = [&] {
    const std::vector<Lease> held = held_["a"];
    for (const Lease& lease : held) {
      if (lease.frame.job_id != large) continue;
      Fail(lease, FailureKind::kInfrastructure, "no room");
      failures_["a"].back().cache_needed_bytes = uint64_t{14} << 20;
      failures_["a"].back().cache_room_bytes = uint64_t{8} << 20;
    }
  };
  Sync("a", 2);
  ASSERT_EQ(held_["a"].at(0).frame.job_id, large);
  refuse();
  for (const Lease& lease : Sync("a", 4)) EXPECT_EQ(lease.frame.job_id, small);
  EXPECT_FALSE(held_["a"].empty());
  EXPECT_THAT(scheduler_.WaitingReason(Job(large)),
              HasSubstr("needs 14 MiB of scene cache; workers have 8 MiB"));
  EXPECT_EQ(scheduler_.WaitingReason(Job(small)), "");
  EXPECT_EQ(Job(large).failures.count, 1) << "leases of one load";
  EXPECT_TRUE(FrameOf(large).failures.empty()) << "no budget";

  // It asks again, more and more rarely.
  for (int attempt = 2; attempt < 30; ++attempt) {
    now_ += limits_.retry_delay_max;
    Sync("a", 0);
    held_["a"].clear();
    Sync("a", 8);
    refuse();
    Sync("a", 8);
    EXPECT_EQ(Job(large).phase, JobPhase::kLive);
    EXPECT_EQ(Job(large).failures.count, attempt);
  }
  // Another worker has room; it is not waited for that the first one checks its results.
  const std::vector<Lease>& of_b = Sync("b", 1);
  ASSERT_EQ(of_b.size(), 1u);
  EXPECT_EQ(of_b[0].frame.job_id, large);
  EXPECT_EQ(scheduler_.WaitingReason(Job(large)), "");
  const Lease first = of_b[0];
  EXPECT_FALSE(Accept(first));
  scheduler_.ConsiderCheck(first.frame, first.task, {"b", "bits"}, 0.0);
  EXPECT_EQ(scheduler_.counters().checks_begun, 0u);
}

TEST_F(TroublesTest, AJobThatIsAloneIsDelayedWhereItsSceneHasNoRoom) {
  const uint64_t job = AddJob();
  absl::Duration delay = limits_.retry_delay_initial;
  for (int attempt = 1; attempt <= 3; ++attempt) {
    ASSERT_FALSE(Sync("a", 2).empty()) << attempt;
    const std::vector<Lease> held = held_["a"];
    for (const Lease& lease : held) {
      Fail(lease, FailureKind::kInfrastructure, "no room");
      failures_["a"].back().cache_needed_bytes = uint64_t{14} << 20;
      failures_["a"].back().cache_room_bytes = uint64_t{8} << 20;
    }
    EXPECT_TRUE(Sync("a", 2).empty()) << attempt;
    now_ += delay / 2;
    EXPECT_TRUE(Sync("a", 2).empty()) << attempt;
    EXPECT_EQ(Job(job).failures.count, attempt);
    EXPECT_FALSE(Sync("b", 1).empty()) << "another worker is not delayed";
    Sync("b", 0);
    held_["b"].clear();
    now_ += delay / 2;
    delay *= 2;
  }
}

TEST_F(TroublesTest, BudgetsAreThoseOfTheirClass) {
  AddJob();
  FailFirstTask({"a", "b"}, FailureKind::kInvalid);
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 1u) << "two refused results are enough";
  EXPECT_EQ(scheduler_.counters().failures[static_cast<size_t>(FailureKind::kInvalid)], 2u);
}

TEST_F(TroublesTest, MessagesGiveOneExampleAndACount) {
  const uint64_t job = AddJob(2);
  ASSERT_TRUE(scheduler_.Kill({job, 2}, std::nullopt, "killed by anna").ok());
  for (const std::string id : {"a", "b"}) Sync(id, 0);
  for (int task = 0; task < 2; ++task) {
    for (const std::string id : {"a", "b"}) {
      Fail(Sync(id, 1).at(0), FailureKind::kInvalid, "refused");
      Sync(id, 0);
    }
  }
  const std::string text = IncompleteText(FrameOf(job));
  EXPECT_THAT(text, HasSubstr("2 tasks are set aside, such as frame 1, tile [0, 32) x [0, 32)"));
  EXPECT_EQ(text.find("refused"), text.rfind("refused")) << text;
  ASSERT_TRUE(scheduler_.Kill({job, 1}, std::nullopt, "killed by anna").ok());
  EXPECT_THAT(Job(job).failure, HasSubstr("2 of 2 frames are incomplete, such as frame 1: "));
}

TEST_F(TroublesTest, ClassesAddUp) {
  AddJob();
  Sync("d", 0);
  FailFirstTask({"a"}, FailureKind::kInternal);
  FailFirstTask({"b"}, FailureKind::kInvalid);
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 0u);
  FailFirstTask({"c"}, FailureKind::kInternal);
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 1u);
}

TEST_F(TroublesTest, ScenesThatFitNoMemoryLeaveTheirFrameIncomplete) {
  const uint64_t job = AddJob(2);
  for (const std::string id : {"a", "b", "c"}) Sync(id, 0);
  for (const std::string id : {"a", "b", "c"}) {
    warm_ = {Job(job).frames[0].packed.scene().Hex()};
    Fail(Sync(id, 1).at(0), FailureKind::kMemory, "needs 3 GiB");
    Sync(id, 0);
  }
  EXPECT_EQ(FrameOf(job).phase, FrameRecord::Phase::kIncomplete);
  EXPECT_THAT(IncompleteText(FrameOf(job)),
              HasSubstr("a, b, c lack the memory to load its scene; worker c says: needs 3 GiB"));
  EXPECT_EQ(Job(job).phase, JobPhase::kLive) << "the other frame continues";
  warm_.clear();
  RenderAllBy("a");
  scheduler_.Deliver({job, 2});
  EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
  EXPECT_THAT(Job(job).failure, HasSubstr("1 of 2 frames is incomplete: frame 1: "));
}

TEST_F(TroublesTest, AloneAWorkerGoesOnWithOtherTasksUntilItIsClear) {
  const uint64_t job = AddJob();
  for (int i = 0; i < limits_.lone_memory_failures_max; ++i) {
    Fail(Sync("a", 1).at(0), FailureKind::kMemory);
    Sync("a", 0);
  }
  EXPECT_TRUE(Sync("a", 1).empty());
  EXPECT_EQ(scheduler_.WaitingReason(Job(job)),
            absl::StrCat("waiting for another worker: a failed frame 1 by lack of memory; "
                         "to end the wait: another worker, sheaf retry jobs/",
                         job, ", or sheaf kill jobs/", job,
                         " --frame 1; if no other worker will join the farm, sheaf-coordinator "
                         "--poison-workers 1"));
  EXPECT_FALSE(Sync("b", 1).empty());
}

TEST_F(TroublesTest, LateResultsHealWhatWasSetAside) {
  const uint64_t job = AddJob();
  const Lease slow = Sync("e", 1).at(0);
  while (Sync("d", 1).at(0).task != slow.task) Accept(held_["d"][0]);
  for (const std::string id : {"d", "a", "b"}) {
    ASSERT_EQ(Sync(id, 1).at(0).task, slow.task) << "a hedge";
    Fail(held_[id][0], FailureKind::kInternal);
    Sync(id, 0);
  }
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 1u);
  EXPECT_EQ(Job(job).phase, JobPhase::kLive) << "e still renders it";
  EXPECT_TRUE(Accept(slow));
  EXPECT_TRUE(FrameOf(job).failures.empty());
  EXPECT_TRUE(scheduler_.Deliver({job, 1}));
}

TEST_F(TroublesTest, WorkersFailingSeveralJobsAreSick) {
  Sync("b", 0);
  for (int i = 0; i < limits_.sick_jobs_min; ++i) {
    warm_.push_back(Job(AddJob()).frames[0].packed.scene().Hex());
  }
  std::vector<Lease> leases = Sync("a", 16);
  std::map<uint64_t, Lease> by_job;
  for (const Lease& lease : leases) by_job[lease.frame.job_id] = lease;
  ASSERT_EQ(static_cast<int>(by_job.size()), limits_.sick_jobs_min);
  for (const auto& [id, lease] : by_job) Fail(lease, FailureKind::kInternal);
  Sync("a", 0);
  EXPECT_TRUE(status_.ok()) << "the scenes may be at fault";
  for (const auto& [id, failed] : by_job) {
    const std::vector<Lease> of_b = Sync("b", 48);
    const auto same = std::find_if(of_b.begin(), of_b.end(), [&](const Lease& lease) {
      return lease.frame == failed.frame && lease.task == failed.task;
    });
    ASSERT_NE(same, of_b.end());
    Accept(*same);
  }
  EXPECT_TRUE(Sync("a", 16).empty());
  EXPECT_TRUE(status_.ok()) << "it stays connected";
  EXPECT_EQ(scheduler_.counters().workers_sick, 1u);
  EXPECT_EQ(scheduler_.counters().workers_quarantined, 0u);
  EXPECT_THAT(scheduler_.workers().workers().at("a").sick_reason,
              HasSubstr("it failed tasks of 3 jobs that others rendered; last: worker a says"));
  EXPECT_FALSE(Sync("a-again", 1).empty()) << "a worker that started again is another one";
  EXPECT_TRUE(scheduler_.LiftQuarantine("a"));
  EXPECT_FALSE(Sync("a", 1).empty());
}

TEST_F(TroublesTest, FailuresOfLongAgoMakeNobodySick) {
  Sync("b", 0);
  for (int i = 0; i < 2 * limits_.sick_jobs_min; ++i) {
    const uint64_t job = AddJob();
    const Lease lease = Sync("a", 1).at(0);
    Fail(lease, FailureKind::kInternal);
    Sync("a", 0);
    Accept(Sync("b", 1).at(0));
    scheduler_.EndJob(job, JobPhase::kCancelled, "");
    now_ += limits_.sick_window / 2 + absl::Seconds(1);
    Sync("b", 0);
  }
  EXPECT_EQ(scheduler_.counters().workers_sick, 0u);
}

TEST_F(TroublesTest, ScenesThatEndEachWorkerMakeNoneSick) {
  const std::vector<std::string> workers = {"a", "b", "c"};
  for (const std::string& worker : workers) Sync(worker, 0);
  for (int i = 0; i < 2 * limits_.sick_jobs_min; ++i) {
    const uint64_t job = AddJob();
    for (int round = 0; round < 90 && Job(job).phase == JobPhase::kLive; ++round) {
      const std::string& worker = workers[static_cast<size_t>(round) % workers.size()];
      const std::vector<Lease> leases = Sync(worker, 16);
      for (const Lease& lease : leases) Fail(lease, FailureKind::kInternal, "its process crashed");
      Sync(worker, 0);
    }
    EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
  }
  EXPECT_EQ(scheduler_.counters().workers_sick, 0u);
}

TEST_F(TroublesTest, TroublesSurviveARestart) {
  const uint64_t job = AddJob();
  Sync("d", 0);
  FailFirstTask({"a", "b", "c"}, FailureKind::kInternal);
  Fail(Sync("a", 1).at(0), FailureKind::kInternal, "crash again");
  Sync("a", 0);
  const std::vector<TaskTrouble> troubles = Durable();
  ASSERT_EQ(troubles.size(), 2u);
  const JobSpec spec = [&] {
    JobSpec copy = Job(job).spec;
    for (const FrameRecord& frame : Job(job).frames) copy.frames.push_back(frame.Spec());
    return copy;
  }();
  Scheduler next(limits_, 1'000'000);
  next.AddJob(spec);
  for (const TaskTrouble& trouble : troubles) next.RestoreTrouble(trouble);
  EXPECT_TRUE(next.TakeTroubles().empty());
  const auto sync = [&](const std::string& id) {
    WorkerReport report;
    report.worker_id = report.host = id;
    report.numeric_profile = kProfile;
    report.requested_lease_count = 64;
    return next.Synchronize(report, now_)->leases;
  };
  for (const Lease& lease : sync("a")) {
    EXPECT_NE(lease.task, (Task{0, {0, 16}})) << "it is set aside";
    EXPECT_NE(lease.task, (Task{1, {0, 16}})) << "a failed it";
  }
  const std::vector<Lease> of_b = sync("b");
  ASSERT_EQ(of_b.size(), 1u);
  EXPECT_EQ(of_b[0].task, (Task{1, {0, 16}}));
  EXPECT_EQ(of_b[0].attempt, 1);
}

TEST_F(TroublesTest, RetryBringsBackWhatWasSetAside) {
  const uint64_t job = AddJob();
  Sync("d", 0);
  FailFirstTask({"a", "b", "c"}, FailureKind::kInternal);
  scheduler_.TakeTroubles();
  scheduler_.Retry(job, 1, 3);
  EXPECT_TRUE(scheduler_.TakeTroubles().empty()) << "of another task";
  scheduler_.Retry(job, 1, 0);
  EXPECT_EQ(scheduler_.counters().tasks_retried, 1u);
  const std::map<TaskId, TaskTrouble> changed = scheduler_.TakeTroubles();
  ASSERT_EQ(changed.size(), 1u);
  EXPECT_TRUE(changed.begin()->second.Empty());
  EXPECT_EQ(Sync("a", 1).at(0).task, (Task{0, {0, 16}})) << "its failure is forgotten";
  RenderAllBy("a");
  EXPECT_TRUE(scheduler_.Deliver({job, 1}));
}

TEST_F(TroublesTest, KilledTasksAreRenderedByNobody) {
  const uint64_t job = AddJob();
  Sync("a", 1);
  ASSERT_TRUE(scheduler_.Kill({job, 1}, 0, "killed by ann").ok());
  EXPECT_EQ(scheduler_.leases().size(), 0u);
  held_["a"].clear();
  RenderAllBy("a");
  EXPECT_EQ(FrameOf(job).sample_count_done, 3u * 32 * 32 * 64);
  EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
  EXPECT_THAT(Job(job).failure, HasSubstr("killed by ann"));
}

TEST_F(TroublesTest, KilledFramesEndAtOnce) {
  const uint64_t job = AddJob(2);
  Sync("a", 1);
  ASSERT_TRUE(scheduler_.Kill({job, 1}, std::nullopt, "killed by ann").ok());
  ASSERT_TRUE(scheduler_.Kill({job, 1}, std::nullopt, "again").ok());
  EXPECT_EQ(FrameOf(job).phase, FrameRecord::Phase::kIncomplete);
  EXPECT_EQ(IncompleteText(FrameOf(job)), "killed by ann");
  EXPECT_EQ(scheduler_.TakeIncompleteFrames(), (std::vector<FrameId>{{job, 1}}));
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
  EXPECT_EQ(scheduler_.Kill({job, 2}, 99, "").code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(scheduler_.Kill({job, 3}, std::nullopt, "").code(), absl::StatusCode::kNotFound);
  held_["a"].clear();
  RenderAllBy("a");
  EXPECT_EQ(scheduler_.Kill({job, 2}, std::nullopt, "").code(),
            absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace sheaf::coordinator
