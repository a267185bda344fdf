// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Workers that end in order, against workers that fall silent.
#include <string>
#include <vector>

#include "common/base/digest.h"
#include "coordinator/scheduling/scheduler.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class SchedulerStopTest : public ::testing::Test {
 protected:
  SchedulerStopTest() {
    JobSpec job;
    job.job_id = 1;
    job.numeric_profile = "profile";
    job.partition = {32, 16, 1};
    FrameSpec frame;
    frame.frame_number = 1;
    frame.scene = {Sha256Hex("scene"), 1};
    frame.settings.width_px = frame.settings.height_px = 64;
    frame.settings.window = {0, 0, 64, 64};
    frame.settings.samples = 64;
    frame.frame_digest = Sha256Hex("frame");
    job.frames = {frame};
    EXPECT_TRUE(scheduler_.CheckJob(job).ok());
    scheduler_.AddJob(job);
  }
  static WorkerReport Report(const std::string& id) {
    WorkerReport report;
    report.worker_id = report.host = id;
    report.numeric_profile = "profile";
    return report;
  }
  std::vector<Lease> Sync(const WorkerReport& report) {
    const absl::StatusOr<Scheduler::SynchronizeAnswer> answer =
        scheduler_.Synchronize(report, now_);
    EXPECT_TRUE(answer.ok());
    return answer->leases;
  }
  // The worker's only lease.
  Lease Work(const std::string& id) {
    WorkerReport report = Report(id);
    report.requested_lease_count = 1;
    return Sync(report).at(0);
  }
  const WorkerRecord& Worker(const std::string& id) {
    return scheduler_.workers().workers().at(id);
  }

  Limits limits_;
  Scheduler scheduler_{limits_, 1000};
  SteadyTime now_;
};

TEST_F(SchedulerStopTest, OrderlyShutdownIsNoLoss) {
  WorkerReport holds = Report("holds");
  holds.leases = {{Work("holds").lease_id, LeasePhase::kRendering}};
  Work("stops");
  WorkerReport stops = Report("stops");
  holds.draining = stops.draining = true;
  EXPECT_EQ(Sync(holds).size(), 1u);
  EXPECT_TRUE(Sync(stops).empty());
  EXPECT_FALSE(Worker("holds").Stopped());
  EXPECT_TRUE(Worker("stops").Stopped());

  now_ += limits_.lease_duration + absl::Seconds(1);
  EXPECT_TRUE(scheduler_.Tick(now_));
  EXPECT_TRUE(Worker("holds").lost);
  EXPECT_FALSE(Worker("holds").Stopped()) << "what it held was lost with it";
  EXPECT_FALSE(Worker("stops").lost);
  EXPECT_TRUE(Worker("stops").Stopped());
  EXPECT_EQ(scheduler_.counters().workers_lost, 1u);

  Work("stops");
  EXPECT_FALSE(Worker("stops").Stopped()) << "started again under the same name";
  now_ += limits_.lease_duration + absl::Seconds(1);
  scheduler_.Tick(now_);
  EXPECT_EQ(scheduler_.counters().workers_lost, 2u);
  now_ += limits_.lost_worker_kept;
  scheduler_.Tick(now_);
  EXPECT_TRUE(scheduler_.workers().workers().empty());
}

TEST_F(SchedulerStopTest, OneReportSufficesWhenOtherWorkersStopped) {
  Sync(Report("other"));
  WorkerReport accuser = Report("accuser");
  accuser.failures = {{Work("accuser").lease_id, FailureKind::kScene, "no such file"}};
  Sync(accuser);
  EXPECT_EQ(scheduler_.jobs().at(1).phase, JobPhase::kLive);
  WorkerReport stops = Report("other");
  stops.draining = true;
  Sync(stops);
  EXPECT_EQ(scheduler_.jobs().at(1).phase, JobPhase::kFailed);
}

}  // namespace
}  // namespace sheaf::coordinator
