// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Pauses and priorities.
#include <map>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "coordinator/scheduling/scheduler.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class SchedulerControlTest : public ::testing::Test {
 protected:
  // A job of frames of four tiles with four passes each.
  JobSpec MakeJob(int frame_count = 1, int32_t priority = 0) {
    JobSpec job;
    job.job_id = ++last_job_id_;
    job.priority = priority;
    job.numeric_profile = "profile";
    job.partition = {32, 16, 1};
    for (int i = 1; i <= frame_count; ++i) {
      FrameSpec frame;
      frame.frame_number = i;
      frame.scene = {Sha256Hex(absl::StrCat("scene", job.job_id, "-", i)), 1};
      frame.settings.width_px = frame.settings.height_px = 64;
      frame.settings.window = {0, 0, 64, 64};
      frame.settings.samples = 64;
      frame.frame_digest = Sha256Hex(absl::StrCat(job.job_id, "/", i));
      job.frames.push_back(frame);
    }
    return job;
  }
  uint64_t AddJob(int frame_count = 1, int32_t priority = 0) {
    const JobSpec job = MakeJob(frame_count, priority);
    EXPECT_TRUE(scheduler_.CheckJob(job).ok());
    scheduler_.AddJob(job);
    return job.job_id;
  }
  // The leases that worker `id` holds after a Synchronize.
  std::vector<Lease> Sync(const std::string& id, int wanted) {
    WorkerReport report;
    report.worker_id = report.host = id;
    report.numeric_profile = "profile";
    report.thread_count = 4;  // Workers without results hold at most two leases a thread.
    report.requested_lease_count = wanted;
    const absl::StatusOr<Scheduler::SynchronizeAnswer> answer =
        scheduler_.Synchronize(report, now_);
    EXPECT_TRUE(answer.ok());
    return answer->leases;
  }
  // Returns whether the frame is rendered now.
  bool Accept(const Lease& lease) {
    const std::string digest = scheduler_.FindFrame(lease.frame)->Spec().frame_digest;
    EXPECT_EQ(
        scheduler_.FindTask(digest, lease.tile_rect, lease.task.block, lease.cells, lease.lease_id)
            .kind,
        Scheduler::FoundTask::Kind::kWanted);
    return scheduler_.Accept(lease.frame, lease.task, lease.lease_id, lease.worker_id, {}, now_);
  }
  const JobRecord& Job(uint64_t id) { return scheduler_.jobs().at(id); }
  double Share(uint64_t id) { return scheduler_.shares().ShareOfJob(id); }

  // The order of jobs alone, wherever their scenes are warm.
  static Limits WithoutPlacement() {
    Limits limits;
    limits.warm_wait_max = limits.warm_stay_min = absl::ZeroDuration();
    return limits;
  }

  Limits limits_ = WithoutPlacement();
  Scheduler scheduler_{limits_, 1000};
  SteadyTime now_;
  uint64_t last_job_id_ = 0;
};

TEST_F(SchedulerControlTest, PausedJobsGetNoLeasesButFinishLeasedOnes) {
  const uint64_t job = AddJob();
  const Lease held = Sync("a", 1)[0];
  scheduler_.Pause(job, now_);
  EXPECT_EQ(Sync("a", 4).size(), 1u);
  EXPECT_TRUE(Sync("b", 1).empty()) << "a hedge is a lease too";
  EXPECT_FALSE(Accept(held));
  EXPECT_TRUE(Sync("a", 4).empty());
  EXPECT_EQ(scheduler_.WaitingReason(Job(job)), "");
  const uint64_t other = AddJob();
  EXPECT_EQ(Sync("b", 1)[0].frame.job_id, other);
  scheduler_.Resume(job, now_);
  EXPECT_EQ(Sync("a", 1)[0].frame.job_id, job);
}

TEST_F(SchedulerControlTest, OwnersAreLimitedEachAlone) {
  Limits limits;
  limits.owner_frames_max = 5;
  Scheduler scheduler(limits, 1000);
  const auto job_of = [&](const std::string& owner, int frame_count) {
    JobSpec job = MakeJob(frame_count);
    job.owner = owner;
    return job;
  };
  const JobSpec first = job_of("anna", 3);
  ASSERT_TRUE(scheduler.CheckOwner(first).ok());
  scheduler.AddJob(first);
  const JobSpec second = job_of("anna", 2);
  ASSERT_TRUE(scheduler.CheckOwner(second).ok());
  scheduler.AddJob(second);
  EXPECT_TRUE(absl::IsResourceExhausted(scheduler.CheckOwner(job_of("anna", 1))));
  EXPECT_EQ(scheduler.counters().jobs_refused, 1u);
  EXPECT_TRUE(scheduler.CheckOwner(job_of("ben", 5)).ok());
  EXPECT_TRUE(scheduler.CheckOwner(job_of(kLocalOwner, 100)).ok()) << "that is everybody";
  scheduler.EndJob(first.job_id, JobPhase::kCancelled, "");
  EXPECT_TRUE(scheduler.CheckOwner(job_of("anna", 3)).ok());
  EXPECT_FALSE(scheduler.CheckOwner(job_of("anna", 4)).ok());
  scheduler.EndJob(first.job_id, JobPhase::kCancelled, "");
  EXPECT_FALSE(scheduler.CheckOwner(job_of("anna", 4)).ok()) << "it has ended once";
}

TEST_F(SchedulerControlTest, PausedTimeIsNotCounted) {
  const uint64_t job = AddJob();
  Sync("a", 1);
  const SteadyTime first = Job(job).frames[0].first_lease_time;
  scheduler_.Pause(job, now_ + absl::Seconds(5));
  scheduler_.Pause(job, now_ + absl::Seconds(50));  // Again: it stays paused since then.
  EXPECT_EQ(Job(job).paused_time, now_ + absl::Seconds(5));
  scheduler_.Resume(job, now_ + absl::Seconds(65));
  scheduler_.Resume(job, now_ + absl::Seconds(70));
  EXPECT_EQ(Job(job).frames[0].first_lease_time, first + absl::Seconds(60));
}

TEST_F(SchedulerControlTest, EndedJobsAreNotPaused) {
  const uint64_t job = AddJob();
  scheduler_.Pause(job, now_);
  scheduler_.EndJob(job, JobPhase::kCancelled, "");
  EXPECT_FALSE(Job(job).Paused());
  scheduler_.Pause(job, now_);
  EXPECT_FALSE(Job(job).Paused());
  EXPECT_TRUE(Sync("a", 1).empty());
}

// Work that others got meanwhile gives no claim: all get equal shares from then on.
TEST_F(SchedulerControlTest, ResumedAndPromotedJobsStartAtTheMinimumServed) {
  const uint64_t first = AddJob(4), second = AddJob(4);
  scheduler_.Pause(first, now_);
  Sync("a", 8);
  scheduler_.Resume(first, now_);
  EXPECT_EQ(Share(first), Share(second));
  const uint64_t urgent = AddJob(4, 10);
  Sync("b", 4);
  scheduler_.SetPriority(first, 10);
  EXPECT_EQ(Share(first), Share(urgent));
  std::map<uint64_t, int> leases;
  for (const Lease& lease : Sync("c", 8)) ++leases[lease.frame.job_id];
  EXPECT_EQ(leases, (std::map<uint64_t, int>{{first, 4}, {urgent, 4}}));
  scheduler_.SetPriority(second, 11);
  EXPECT_EQ(Sync("d", 1)[0].frame.job_id, second);
  EXPECT_TRUE(scheduler_.CheckPriority(-1000).ok());
  for (const int32_t wrong : {1001, -1001, INT32_MIN}) {
    EXPECT_EQ(scheduler_.CheckPriority(wrong).code(), absl::StatusCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace sheaf::coordinator
