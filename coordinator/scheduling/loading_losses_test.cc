// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/loading_losses.h"

#include <memory>
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
using ::testing::HasSubstr;

TEST(LoadingLossesTest, SimultaneousLossesCountOnce) {
  LoadingLosses losses;
  const SteadyTime start;
  EXPECT_TRUE(losses.Add("a", start, start + absl::Seconds(9)));
  EXPECT_FALSE(losses.Add("b", start + absl::Seconds(8), start + absl::Seconds(20)));
  EXPECT_TRUE(losses.Add("c", start + absl::Seconds(9), start + absl::Seconds(20)));
  EXPECT_FALSE(losses.Add("c", start + absl::Seconds(30), start + absl::Seconds(40)));
  EXPECT_THAT(losses.workers(), ElementsAre("a", "c"));
  losses.Clear();
  EXPECT_EQ(losses.count(), 0);
}

class LoadingSchedulerTest : public ::testing::Test {
 protected:
  void AddJob(int frame_count) {
    JobSpec job;
    job.job_id = ++jobs_;
    job.numeric_profile = "profile";
    job.partition = {32, 16, 1};
    for (int i = 1; i <= frame_count; ++i) {
      FrameSpec frame;
      frame.frame_number = i;
      frame.scene = {Sha256Hex(absl::StrCat("scene", job.job_id, "-", i)), 1};
      frame.settings.width_px = frame.settings.height_px = 64;
      frame.settings.window = {0, 0, 64, 64};
      frame.settings.samples = 64;
      frame.frame_digest = Sha256Hex(absl::StrCat("digest", job.job_id, "-", i));
      job.frames.push_back(frame);
    }
    scheduler_->AddJob(job);
  }
  std::vector<Lease> Sync(const std::string& id, int wanted,
                          const std::vector<LeaseReport>& held = {}) {
    WorkerReport report;
    report.worker_id = report.host = id;
    report.numeric_profile = "profile";
    report.requested_lease_count = wanted;
    report.leases = held;
    return scheduler_->Synchronize(report, now_)->leases;
  }
  // The worker takes two leases, reaches the phase with both, and falls silent.
  std::vector<Lease> Take(const std::string& id, LeasePhase phase) {
    const std::vector<Lease> leases = Sync(id, 2);
    std::vector<LeaseReport> held;
    for (const Lease& lease : leases) held.push_back({lease.lease_id, phase});
    Sync(id, 2, held);
    return leases;
  }
  void PassLeaseDuration() {
    now_ += limits_.lease_duration + absl::Seconds(1);
    scheduler_->Tick(now_);
    scheduler_->TakeFailureJobs(absl::UnixEpoch() + (now_ - SteadyTime()));
  }
  void Vanish(const std::string& id, LeasePhase phase = LeasePhase::kLoading) {
    Take(id, phase);
    PassLeaseDuration();
  }
  const JobRecord& Job(uint64_t id = 1) { return scheduler_->jobs().at(id); }

  Limits limits_;
  std::unique_ptr<Scheduler> scheduler_ = std::make_unique<Scheduler>(limits_, 1000);
  SteadyTime now_;
  uint64_t jobs_ = 0;
};

TEST_F(LoadingSchedulerTest, CrashingScenesFailOnlyTheirJob) {
  AddJob(1);
  AddJob(1);
  for (int i = 0; i < limits_.loading_losses_max; ++i) {
    ASSERT_EQ(Job().phase, JobPhase::kLive) << i;
    scheduler_->SetPriority(1, 1);
    Vanish(absl::StrCat("w", i));
  }
  EXPECT_EQ(Job().phase, JobPhase::kFailed);
  EXPECT_THAT(Job().failure, HasSubstr("w0, w1, w2"));
  EXPECT_THAT(Job().failure, HasSubstr("memory"));
  ASSERT_EQ(Job().failures.count, 3) << "one a worker, however many threads waited for the scene";
  EXPECT_EQ(Job().failures.last.back().kind, FailureKind::kLoading);
  EXPECT_EQ(Job(2).phase, JobPhase::kLive);
  EXPECT_EQ(Sync("x", 1)[0].frame.job_id, 2u);
}

TEST_F(LoadingSchedulerTest, SimultaneousShutdownsFailNoJob) {
  AddJob(1);
  for (int i = 0; i < 20; ++i) {
    Take(absl::StrCat("w", i), LeasePhase::kLoading);
    now_ += absl::Milliseconds(100);
  }
  PassLeaseDuration();
  EXPECT_EQ(scheduler_->counters().workers_lost, 20u);
  EXPECT_EQ(Job().phase, JobPhase::kLive);
}

TEST_F(LoadingSchedulerTest, ScenesLoadedOnceAreNotBlamed) {
  AddJob(1);
  Vanish("renders", LeasePhase::kRendering);
  for (int i = 0; i < 3 * limits_.loading_losses_max; ++i) Vanish(absl::StrCat("w", i));
  EXPECT_EQ(Job().phase, JobPhase::kLive);
}

TEST_F(LoadingSchedulerTest, WaitingOrReleasedLeasesAreNotBlamed) {
  AddJob(1);
  for (int i = 0; i < 20; ++i) Vanish(absl::StrCat("w", i), LeasePhase::kQueued);
  EXPECT_EQ(Job().phase, JobPhase::kLive);
  EXPECT_EQ(Job().failures.count, 0);
}

// A cold worker takes a frame of its own, so no frame of a long job ends many workers.
TEST_F(LoadingSchedulerTest, LossesOfAJobsFramesCountTogether) {
  AddJob(100);
  for (int i = 0; i + 1 < limits_.job_loading_losses_max; ++i) Vanish(absl::StrCat("w", i));
  EXPECT_EQ(Job().phase, JobPhase::kLive);
  Vanish("renders", LeasePhase::kRendering);
  for (int i = 0; i < limits_.job_loading_losses_max; ++i) {
    ASSERT_EQ(Job().phase, JobPhase::kLive) << i;
    Vanish(absl::StrCat("v", i));
  }
  EXPECT_EQ(Job().phase, JobPhase::kFailed);
}

TEST_F(LoadingSchedulerTest, LossesSurviveARestart) {
  AddJob(1);
  for (int i = 0; i + 1 < limits_.loading_losses_max; ++i) Vanish(absl::StrCat("w", i));
  const FailureLog known = Job().failures;
  scheduler_ = std::make_unique<Scheduler>(limits_, 2000);
  jobs_ = 0;
  now_ = SteadyTime() - absl::Hours(1);  // The clock was set meanwhile.
  AddJob(1);
  scheduler_->RestoreFailures(1, known);
  EXPECT_EQ(Job().phase, JobPhase::kLive);
  Vanish("x");
  EXPECT_EQ(Job().phase, JobPhase::kFailed);
}

}  // namespace
}  // namespace sheaf::coordinator
