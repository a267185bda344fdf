// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Guided frames: the training is leased first, and everything else with its field.
#include <set>
#include <string>
#include <vector>

#include "coordinator/scheduling/tests/scheduler_fixture.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class TrainingTest : public SchedulerTest {
 protected:
  // A job of one guided frame with light paths, of one tile, and its training.
  void AddGuidedJob() {
    JobSpec job;
    job.job_id = ++last_job_id_;  // 1.
    job.numeric_profile = kProfile;
    job.partition = {64, 16, 4};
    job.frames.push_back(Frame(1, "scene", 1));
    job.frames[0].settings.techniques = TechniqueSet::kCameraAndLightGuided;
    ASSERT_TRUE(scheduler_.CheckJob(job).ok());
    scheduler_.AddJob(job);
  }
  Scheduler::FoundTask Find(const Lease& lease, const std::string& field) {
    return scheduler_.FindTask(Digest(1), lease.tile_rect, lease.task.block, lease.cells,
                               lease.lease_id, lease.kind, field);
  }
  void AcceptTraining(const Lease& lease, const std::string& worker) {
    ASSERT_EQ(lease.kind, TaskKind::kTraining);
    ASSERT_EQ(Find(lease, "").kind, Scheduler::FoundTask::Kind::kWanted);
    scheduler_.SetField(lease.frame, kField);
    EXPECT_FALSE(scheduler_.Accept(lease.frame, lease.task, lease.lease_id, worker,
                                   {1, 0, absl::Seconds(5), 7}, now_));
    std::erase_if(held_[worker], [&](const Lease& l) { return l.lease_id == lease.lease_id; });
  }

  const BlobDigest kField{Digest(77), 7};
};

TEST_F(TrainingTest, NothingElseOfTheFrameIsLeasedBefore) {
  AddGuidedJob();
  const std::vector<Lease> training = Sync("w", 8);
  ASSERT_EQ(training.size(), 1u);
  EXPECT_EQ(training[0].tile_rect, (PixelRect{0, 0, 64, 64}));
  EXPECT_EQ(training[0].field, BlobDigest());
  const uint64_t other = AddJob();
  EXPECT_EQ(Sync("v", 1)[0].frame.job_id, other) << "other frames fill the gap";
  AcceptTraining(training[0], "w");
  EXPECT_EQ(Job(1).frames[0].sample_count_done, 0u);
  EXPECT_EQ(Job(1).frames[0].cost.cpu_duration, absl::Seconds(5));
  EXPECT_EQ(scheduler_.workers().workers().at("w").SamplesPerThreadSecond(), 0);
  std::set<TaskKind> kinds;
  for (const Lease& lease : Sync("w", 8)) {
    if (lease.frame.job_id != 1) continue;
    kinds.insert(lease.kind);
    EXPECT_EQ(lease.field, kField);
  }
  EXPECT_EQ(kinds, (std::set<TaskKind>{TaskKind::kCamera, TaskKind::kLight}));
}

TEST_F(TrainingTest, AnIdleWorkerTrainsToo) {
  AddGuidedJob();
  const Lease first = Sync("w", 1)[0], second = Sync("v", 1)[0];
  EXPECT_EQ(second.task, first.task);
  AcceptTraining(second, "v");
  EXPECT_EQ(Find(first, "").kind, Scheduler::FoundTask::Kind::kCovered);
  for (const Lease& lease : Sync("w", 1)) EXPECT_NE(lease.kind, TaskKind::kTraining);
}

TEST_F(TrainingTest, ALostTrainingIsLeasedToAnother) {
  AddGuidedJob();
  const Lease first = Sync("w", 1)[0];
  Fail(first, FailureKind::kInternal);
  Sync("w", 0);
  const std::vector<Lease> again = Sync("v", 8);
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again[0].task, first.task);
  EXPECT_EQ(again[0].attempt, 1);
}

TEST_F(TrainingTest, ALostFieldIsTrainedAgain) {
  AddGuidedJob();
  AcceptTraining(Sync("w", 1)[0], "w");
  const std::vector<Lease> before = Sync("w", 2);
  ASSERT_EQ(before.size(), 2u);
  scheduler_.Revoke({1, 1}, {2, {0, 1}, 1});
  // Leased tasks continue. No other worker gets them, because the field could not be read.
  EXPECT_EQ(Find(before[0], kField.sha256_hex).kind, Scheduler::FoundTask::Kind::kWanted);
  const std::vector<Lease> training = Sync("v", 8);
  ASSERT_EQ(training.size(), 1u);
  Sync("u", 1);
  EXPECT_EQ(held_["u"].front().kind, TaskKind::kTraining) << "a hedge";
  AcceptTraining(training[0], "v");
  EXPECT_FALSE(Sync("v", 1).empty());
}

TEST_F(TrainingTest, ResultsOfOtherFieldsAreFoundOut) {
  AddGuidedJob();
  using Kind = Scheduler::FoundTask::Kind;
  AcceptTraining(Sync("w", 1)[0], "w");
  const Lease lease = Sync("w", 1)[0];
  EXPECT_EQ(Find(lease, "").kind, Kind::kOtherField);
  EXPECT_EQ(Find(lease, Digest(78)).kind, Kind::kOtherField);
  EXPECT_EQ(Find(lease, kField.sha256_hex).kind, Kind::kWanted);
}

// The fraction of tasks that are checked does not matter, but that there is one.
TEST_F(TrainingTest, TrainingsAreAlwaysChecked) {
  AddGuidedJob();
  Sync("v", 0);
  const Lease training = Sync("w", 1)[0];
  AcceptTraining(training, "w");
  const ResultVersion version{"w", kField.sha256_hex};
  scheduler_.ConsiderCheck(training.frame, training.task, version, /*draw=*/0.999999);
  EXPECT_EQ(scheduler_.checks().size(), 1u);
  const std::vector<Lease> leases = Sync("v", 2);
  ASSERT_EQ(leases.size(), 2u);
  EXPECT_TRUE(leases[0].is_check);
  EXPECT_EQ(leases[0].kind, TaskKind::kTraining) << "before all that depends on it";
  EXPECT_EQ(leases[1].field, kField);
}

}  // namespace
}  // namespace sheaf::coordinator
