// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Jobs that wait for others, frames that wait for approval, and workers that are drained.
#include <string>
#include <utility>
#include <vector>

#include "coordinator/core/job/job_approval.h"
#include "coordinator/scheduling/tests/scheduler_fixture.h"
#include "gmock/gmock.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

class SchedulerHoldsTest : public SchedulerTest {
 protected:
  // Like those of AddJob.
  JobSpec MakeJob(int frame_count, std::vector<JobDependency> dependencies,
                  uint64_t approve_after = 0) {
    JobSpec job;
    job.job_id = ++last_job_id_;
    job.numeric_profile = kProfile;
    job.partition = {32, 16, 1};
    for (int i = 1; i <= frame_count; ++i) {
      job.frames.push_back(
          Frame(i, absl::StrCat("scene", job.job_id, "-", i), job.job_id * 100 + i));
    }
    job.dependencies = std::move(dependencies);
    EXPECT_TRUE(HoldForApproval(approve_after, &job).ok());
    return job;
  }
  uint64_t Add(const JobSpec& job) {
    EXPECT_TRUE(scheduler_.CheckJob(job).ok()) << scheduler_.CheckJob(job);
    scheduler_.AddJob(job);
    return job.job_id;
  }
  uint64_t AddAfter(int frame_count, std::vector<JobDependency> dependencies) {
    return Add(MakeJob(frame_count, std::move(dependencies)));
  }
  // Renders and delivers a frame; leases of others stay.
  void Finish(const FrameId& id) {
    while (scheduler_.FindFrame(id)->phase != FrameRecord::Phase::kRendered) {
      std::vector<Lease> of_frame;
      for (const Lease& lease : Sync("w", 200)) {
        if (lease.frame == id) of_frame.push_back(lease);
      }
      ASSERT_FALSE(of_frame.empty());
      for (const Lease& lease : of_frame) Accept(lease);
    }
    scheduler_.Deliver(id);
  }
  bool IsLeased(const FrameId& id) {
    for (const Lease& lease : Sync("w", 200)) {
      if (lease.frame == id) return true;
    }
    return false;
  }
  std::string Why(uint64_t job) { return scheduler_.WaitingReason(Job(job)); }
};

TEST_F(SchedulerHoldsTest, AJobWaitsForAWholeJob) {
  const uint64_t first = AddJob(2), second = AddAfter(1, {{first}});
  EXPECT_FALSE(IsLeased({second, 1}));
  EXPECT_EQ(Why(second), absl::StrCat("waiting for jobs/", first));
  Finish({first, 1});
  EXPECT_FALSE(IsLeased({second, 1})) << "a frame is left";
  Finish({first, 2});
  EXPECT_TRUE(IsLeased({second, 1}));
  EXPECT_EQ(Why(second), "");
  EXPECT_EQ(DependencyText(scheduler_.jobs(), Job(second), {first}), "done");
}

TEST_F(SchedulerHoldsTest, FramesWaitForFrames) {
  const uint64_t first = AddJob(3), second = AddAfter(3, {{first, true}});
  EXPECT_TRUE(Job(second).pending.empty());
  EXPECT_THAT(Why(second),
              HasSubstr(absl::StrCat("with 3 frames: frame 1 for that of jobs/", first)));
  Finish({first, 2});
  EXPECT_TRUE(IsLeased({second, 2}));
  EXPECT_FALSE(IsLeased({second, 1}));
  Finish({second, 2});
  EXPECT_THAT(Why(second), HasSubstr("with 2 frames: frame 1"));
  EXPECT_THAT(WhyFrameWaits(scheduler_.jobs(), Job(second), Job(second).frames[0]),
              absl::StrCat("waits for frame 1 of jobs/", first));
  Finish({first, 1});
  Finish({first, 3});
  EXPECT_EQ(Job(first).phase, JobPhase::kSucceeded);
  Finish({second, 3});
  Finish({second, 1});
  EXPECT_EQ(Job(second).phase, JobPhase::kSucceeded);
}

// A late result from before a restart may open a frame that waits.
TEST_F(SchedulerHoldsTest, AFrameThatIsOpenGetsNoLeaseEither) {
  const uint64_t first = AddJob(1), second = AddAfter(1, {{first, true}});
  const FrameSpec frame = scheduler_.FindFrame({second, 1})->Spec();
  const Scheduler::FoundTask found =
      scheduler_.FindTask(frame.frame_digest, {0, 0, 32, 32}, {0, 16}, {}, 0);
  ASSERT_EQ(found.kind, Scheduler::FoundTask::Kind::kWanted);
  scheduler_.Accept({second, 1}, found.task, 0, "w", {}, now_);
  EXPECT_EQ(Job(second).frames[0].phase, FrameRecord::Phase::kOpen);
  EXPECT_FALSE(IsLeased({second, 1}));
  EXPECT_THAT(Why(second), HasSubstr("with 1 frame: frame 1"));
  Finish({first, 1});
  Finish({second, 1});
  EXPECT_EQ(Job(second).phase, JobPhase::kSucceeded);
}

TEST_F(SchedulerHoldsTest, AJobThatWaitsInVainSaysWhatToDo) {
  const uint64_t first = AddJob(1), second = AddAfter(1, {{first}});
  const uint64_t third = AddAfter(1, {{first, true}});
  scheduler_.EndJob(first, JobPhase::kFailed, "broken");
  const std::string remedy = absl::StrCat(
      "has failed: sheaf release jobs/", second, " starts this job anyway, sheaf retry jobs/",
      first, " tries that one again, sheaf cancel jobs/", second, " ends this one");
  EXPECT_THAT(Why(second), HasSubstr(remedy));
  EXPECT_THAT(Why(third), HasSubstr(absl::StrCat("sheaf release jobs/", third)));
  EXPECT_TRUE(scheduler_.IsAwaited(first));
  EXPECT_FALSE(IsLeased({second, 1}));
  scheduler_.Release(second);
  EXPECT_TRUE(IsLeased({second, 1}));
  EXPECT_EQ(DependencyText(scheduler_.jobs(), Job(second), Job(second).spec.dependencies[0]),
            "released");
  EXPECT_FALSE(IsLeased({third, 1}));
  scheduler_.Release(third);
  EXPECT_TRUE(IsLeased({third, 1}));
  EXPECT_FALSE(scheduler_.IsAwaited(first));
}

TEST_F(SchedulerHoldsTest, IncompleteAndCancelledJobsAreWaitedForInVain) {
  const uint64_t first = AddJob(2), second = AddAfter(2, {{first, true}});
  const uint64_t third = AddAfter(1, {{first}});
  ASSERT_TRUE(scheduler_.Kill({first, 1}, std::nullopt, "killed").ok());
  EXPECT_THAT(Why(third), HasSubstr("has incomplete frames: sheaf release"));
  EXPECT_THAT(Why(second), HasSubstr("has incomplete frames"));
  Finish({first, 2});
  EXPECT_EQ(Job(first).phase, JobPhase::kFailed);
  EXPECT_TRUE(IsLeased({second, 2})) << "its frame is delivered";
  EXPECT_FALSE(IsLeased({second, 1}));
  EXPECT_FALSE(IsLeased({third, 1}));
  const uint64_t fourth = AddJob(1), fifth = AddAfter(1, {{fourth}});
  scheduler_.EndJob(fourth, JobPhase::kCancelled, "");
  EXPECT_THAT(Why(fifth), HasSubstr("was cancelled: sheaf release"));
  EXPECT_THAT(Why(fifth), ::testing::Not(HasSubstr("retry")));
}

// The job that is waited for begins again, as by a refinement or a retry.
TEST_F(SchedulerHoldsTest, AJobThatBeginsAgainIsWaitedForAgain) {
  const JobSpec job = MakeJob(1, {});
  const uint64_t first = Add(job), second = AddAfter(1, {{first}}),
                 third = AddAfter(1, {{first, true}});
  Finish({first, 1});
  EXPECT_FALSE(Job(second).blocked);
  scheduler_.RemoveJob(first);
  scheduler_.AddJob(job);
  EXPECT_TRUE(Job(second).blocked);
  EXPECT_TRUE(Job(third).frames[0].blocked);
  scheduler_.RestoreDelivered({first, 1}, {}, 64);
  EXPECT_FALSE(Job(third).frames[0].blocked);
  scheduler_.RestoreEnded(first, JobPhase::kSucceeded, "");
  EXPECT_FALSE(Job(second).blocked);
}

TEST_F(SchedulerHoldsTest, ADeliveredJobThatIsRemovedCountsAsDone) {
  const uint64_t first = AddJob(1),
                 second = AddAfter(1,
                                   {
                                       {first},
                                   }),
                 third = AddAfter(1, {{first, true}});
  Finish({first, 1});
  EXPECT_FALSE(scheduler_.IsAwaited(first));
  scheduler_.NoteRemoved(first);
  scheduler_.RemoveJob(first);
  EXPECT_TRUE(IsLeased({second, 1}));
  EXPECT_TRUE(IsLeased({third, 1}));
  EXPECT_EQ(DependencyText(scheduler_.jobs(), Job(second), Job(second).spec.dependencies[0]),
            "done, and removed since");
}

TEST_F(SchedulerHoldsTest, DependenciesThatCannotBeAreRefused) {
  const uint64_t first = AddJob(2), second = AddJob(1);
  const auto refusal = [&](std::vector<JobDependency> dependencies, absl::StatusCode code) {
    const absl::Status status = scheduler_.CheckJob(MakeJob(2, std::move(dependencies)));
    EXPECT_EQ(status.code(), code);
    return std::string(status.message());
  };
  EXPECT_THAT(refusal({{77}}, absl::StatusCode::kNotFound), HasSubstr("no such job"));
  EXPECT_THAT(refusal({{last_job_id_ + 1}}, absl::StatusCode::kNotFound), HasSubstr("no such job"))
      << "a job cannot wait for itself";
  EXPECT_THAT(refusal({{first}, {first, true}}, absl::StatusCode::kInvalidArgument),
              HasSubstr("named twice"));
  EXPECT_THAT(refusal({{second, true}}, absl::StatusCode::kFailedPrecondition),
              HasSubstr("has no frame 2"));
  std::vector<JobDependency> many;
  for (size_t i = 0; i <= limits_.job_dependencies_max; ++i) many.push_back({AddJob()});
  EXPECT_THAT(refusal(many, absl::StatusCode::kInvalidArgument), HasSubstr("16 others at most"));
  scheduler_.EndJob(first, JobPhase::kCancelled, "");
  EXPECT_THAT(refusal({{first}}, absl::StatusCode::kFailedPrecondition),
              HasSubstr("was cancelled"));
}

TEST_F(SchedulerHoldsTest, AJobWaitsForApproval) {
  JobSpec job = MakeJob(2, {}, 16);
  const uint64_t first = Add(job), second = AddAfter(2, {{first, true}});
  Finish({first, 1});
  EXPECT_EQ(Job(first).unapproved_count, 1);
  EXPECT_EQ(Why(first), "") << "the other frame is still to be rendered";
  Finish({first, 2});
  EXPECT_EQ(Job(first).phase, JobPhase::kLive);
  EXPECT_THAT(Why(first), HasSubstr(absl::StrCat("waiting for approval: sheaf approve jobs/", first,
                                                 " has 2 frames rendered to the end")));
  EXPECT_EQ(WhyFrameWaits(scheduler_.jobs(), Job(first), Job(first).frames[1]),
            absl::StrCat("waits for approval with 16 of 64 samples: sheaf approve jobs/", first,
                         " --frames 2"));
  EXPECT_TRUE(Job(second).frames[0].blocked) << "it waits for the final image";
  // The second frame is approved: it begins again with all samples, the first one stays.
  scheduler_.RestoreEnded(first, JobPhase::kCancelled, "");
  scheduler_.RemoveJob(first);
  job.approvals.at(2).approved = true;
  job.frames[1].settings.samples = 64;
  scheduler_.AddJob(job);
  scheduler_.RestoreDelivered({first, 1}, {}, 16);
  EXPECT_EQ(Job(first).unapproved_count, 1);
  Finish({first, 2});
  EXPECT_EQ(Job(first).phase, JobPhase::kLive);
  EXPECT_THAT(Why(first), HasSubstr("has 1 frame rendered"));
  EXPECT_TRUE(IsLeased({second, 2}));
  EXPECT_FALSE(IsLeased({second, 1}));
}

TEST_F(SchedulerHoldsTest, AnIncompleteFrameDoesNotEndAJobThatWaitsForApproval) {
  const uint64_t job = Add(MakeJob(2, {}, 16));
  Finish({job, 1});
  ASSERT_TRUE(scheduler_.Kill({job, 2}, std::nullopt, "killed").ok());
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
  EXPECT_THAT(Why(job), HasSubstr("waiting for approval"));
}

TEST_F(SchedulerHoldsTest, DrainedWorkersFinishWhatTheyHold) {
  const uint64_t job = AddJob(1);
  const Lease held = Sync("a", 1)[0];
  scheduler_.Drain("a", /*then_exit=*/false);
  EXPECT_EQ(Sync("a", 4).size(), 1u) << "it keeps what it holds";
  EXPECT_EQ(scheduler_.workers().LiveCount(), 0);
  Accept(held);
  EXPECT_TRUE(Sync("a", 4).empty());
  EXPECT_THAT(Why(job), HasSubstr("sheaf undrain"));
  scheduler_.Undrain("a");
  EXPECT_EQ(Sync("a", 4).size(), 4u);
  EXPECT_EQ(scheduler_.workers().LiveCount(), 1);
}

TEST_F(SchedulerHoldsTest, DrainedWorkersAreToldToEndWhenTheyHoldNothing) {
  AddJob(1);
  const Lease held = Sync("a", 1)[0];
  scheduler_.Drain("a", /*then_exit=*/true);
  scheduler_.Drain("b", /*then_exit=*/true);  // Not known yet, as after a restart.
  WorkerReport report;
  report.worker_id = report.host = "a";
  report.numeric_profile = kProfile;
  report.requested_lease_count = 1;
  report.leases = {{held.lease_id, LeasePhase::kRendering}};
  EXPECT_FALSE(scheduler_.Synchronize(report, now_)->exits);
  Accept(held);
  report.leases.clear();
  EXPECT_TRUE(scheduler_.Synchronize(report, now_)->exits);
  report.worker_id = "b";
  const Scheduler::SynchronizeAnswer answer = *scheduler_.Synchronize(report, now_);
  EXPECT_TRUE(answer.exits);
  EXPECT_TRUE(answer.leases.empty());
}

}  // namespace
}  // namespace sheaf::coordinator
