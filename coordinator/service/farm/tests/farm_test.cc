// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the farm's durability with a store that is slow on purpose, or damaged.
#include "coordinator/service/farm/farm.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <future>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "common/base/mutex.h"
#include "coordinator/service/farm/tests/farm_fixture.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

// Also where no worker is left that tries again.
TEST_F(FarmTest, JobsReportAFullDiskAndRecover) {
  store_->Open();
  const std::string job = absl::StrCat(MakeJob({}));
  store_->full_ = true;
  Work(absl::ZeroDuration(), absl::StatusCode::kResourceExhausted);
  EXPECT_FALSE(farm_->disk().Last().ok());
  EXPECT_EQ(Metric("sheaf_disk_writable"), 0);
  EXPECT_THAT(farm_->view().FindJob(job)->waiting_reason, HasSubstr("no space left"));
  store_->full_ = false;
  const SteadyTime deadline = SteadyTime::Now() + absl::Seconds(600);
  while (!farm_->disk().Last().ok() && SteadyTime::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  EXPECT_TRUE(farm_->disk().Last().ok());
  EXPECT_EQ(Metric("sheaf_disk_writable"), 1);
  EXPECT_GT(Metric("sheaf_disk_free_bytes"), 0);
  EXPECT_GE(Metric("sheaf_disk_size_bytes"), Metric("sheaf_disk_free_bytes"));
  EXPECT_EQ(farm_->view().FindJob(job)->waiting_reason, "");
  while (!farm_->view().FindJob(job)->frames[0].complete && SteadyTime::Now() < deadline) Work();
  EXPECT_TRUE(farm_->view().FindJob(job)->frames[0].complete);
}

// An end that the disk refuses is written later. A job that is refined meanwhile has none: it keeps
// its parts and continues.
TEST_F(FarmTest, AJobCanBeRefinedBeforeItsEndIsWritten) {
  store_->Open();
  const uint64_t id = MakeJob({});
  const std::string job = absl::StrCat(id);
  const SteadyTime deadline = SteadyTime::Now() + absl::Seconds(600);
  store_->refuses_ends_ = true;
  while (store_->ends_refused_ == 0 && SteadyTime::Now() < deadline) Work(absl::Milliseconds(2));
  ASSERT_TRUE(farm_->RefineJob(id, {.refinement = {{}, 512}}).ok());
  store_->refuses_ends_ = false;
  EXPECT_TRUE(farm_->CancelJob(MakeJob({}, 64)).ok());  // Writes all ends that are due.
  ASSERT_GT(store_->PartsBytes(), 0u);
  const auto view = [&] { return *farm_->view().FindJob(job); };
  while (view().state != JobState::kSucceeded && SteadyTime::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  EXPECT_EQ(view().state, JobState::kSucceeded);
  EXPECT_EQ(view().progress.sample_count_done, 16u * 16u * 512u);
}

// The end of a failed job waits for its failures: a start would find a failed job without a reason.
TEST_F(FarmTest, AFailedJobEndsWithItsFailures) {
  StartWithoutThread();
  store_->Open();
  const uint64_t id = MakeJob({});
  const std::vector<LeaseGrant> grants = Lease("w");
  ASSERT_EQ(grants.size(), 1u);
  const auto stored = [&] {
    const absl::StatusOr<std::vector<StoredJob>> jobs = store_->LoadJobs();
    SHEAF_CHECK(jobs.ok());
    return *std::ranges::find(*jobs, id, [](const StoredJob& job) { return job.spec.job_id; });
  };
  store_->refuses_failures_ = true;
  {
    const MutexLock lock(&farm_->tables().mutex);
    farm_->tables().scheduler.Fail({grants[0].lease.lease_id, FailureKind::kScene, "no camera"},
                                   "w", SteadyTime::Now());
    farm_->tables().NoteEndedJobs();
  }
  farm_->RunOnce();
  ASSERT_EQ(farm_->view().FindJob(absl::StrCat(id))->state, JobState::kFailed);
  EXPECT_EQ(stored().phase, JobPhase::kLive);
  store_->refuses_failures_ = false;
  EXPECT_TRUE(farm_->CancelJob(MakeJob({}, 64)).ok());  // Writes all ends that are due.
  EXPECT_EQ(stored().phase, JobPhase::kFailed);
  EXPECT_EQ(stored().failures.count, 1u);
}

// A write that failed may be on disk all the same, and come back with the next start. The opposite
// is therefore written, although nothing changes.
TEST_F(FarmTest, ResumeIsWrittenAfterAPauseThatFailed) {
  store_->Open();
  const uint64_t job = MakeJob({});
  store_->full_ = true;
  EXPECT_TRUE(absl::IsResourceExhausted(farm_->PauseJob(job)));
  EXPECT_TRUE(absl::IsResourceExhausted(farm_->SetJobPriority(job, {.priority = 5})));
  store_->full_ = false;
  EXPECT_TRUE(farm_->ResumeJob(job).ok());
  EXPECT_TRUE(farm_->SetJobPriority(job, {.priority = 0}).ok());
  EXPECT_EQ(store_->control_writes_, 4);
  EXPECT_EQ(Metric("sheaf_jobs_paused"), 0);
  EXPECT_GT(Metric("sheaf_work_left_cpu_seconds"), 0);
  EXPECT_FALSE(farm_->view().FindJob(absl::StrCat(job))->held);
  EXPECT_TRUE(farm_->PauseJob(job).ok());
  EXPECT_EQ(Metric("sheaf_jobs_paused"), 1);
  EXPECT_EQ(Metric("sheaf_jobs_live"), 1) << "it has not ended";
  EXPECT_EQ(Metric("sheaf_work_left_cpu_seconds"), 0) << "nothing of it may be leased";
  EXPECT_TRUE(farm_->view().FindJob(absl::StrCat(job))->held);
}

// A second call to cancel a job is not answered before the first is durable: after a power cut the
// job would be alive again, although the caller was told otherwise.
TEST_F(FarmTest, SecondCancelWaitsForTheFirst) {
  const uint64_t job = MakeJob({});
  const auto cancel = [&] { return farm_->CancelJob(job); };
  std::future<absl::Status> first = std::async(std::launch::async, cancel);
  store_->WaitUntilSomeoneIsThere();
  std::future<absl::Status> second = std::async(std::launch::async, cancel);
  EXPECT_EQ(second.wait_for(std::chrono::milliseconds(200)), std::future_status::timeout);
  store_->Open();
  EXPECT_TRUE(first.get().ok());
  EXPECT_TRUE(second.get().ok());
}

// Results of one tile are taken one at a time. The sender of one that waits may be found to make
// false results meanwhile, and those are removed: then this one is no longer taken.
TEST_F(FarmTest, AResultThatWaitsIsRefusedWhereItsSenderIsQuarantined) {
  MakeJob({});
  const std::vector<LeaseGrant> honest = Lease("honest"), liar = Lease("liar");
  ASSERT_EQ(honest.size(), 1u);
  ASSERT_EQ(liar.size(), 1u);
  store_->holds_parts_ = true;
  const auto deliver = [&](const LeaseGrant& grant) {
    return std::async(std::launch::async, [&] { return Deliver(grant); });
  };
  std::future<absl::Status> under_way = deliver(honest[0]);
  store_->WaitUntilSomeoneIsThere();
  std::future<absl::Status> waiting = deliver(liar[0]);
  EXPECT_EQ(waiting.wait_for(std::chrono::milliseconds(200)), std::future_status::timeout);
  {
    const MutexLock lock(&farm_->tables().mutex);
    farm_->tables().scheduler.Quarantine("liar", "it lied", /*made_false_results=*/true);
  }
  store_->Open();
  EXPECT_TRUE(under_way.get().ok());
  EXPECT_EQ(waiting.get().code(), absl::StatusCode::kPermissionDenied);
}

// A view during the decision of the first round shows a frame without rounds.
TEST_F(FarmTest, JobsAreReadableDuringRoundDecisions) {
  const std::string job = absl::StrCat(MakeJob({.target_error = 1e-6}));
  Work();
  store_->WaitUntilSomeoneIsThere();
  const auto before = farm_->view().FindJob(job);
  ASSERT_TRUE(before.ok());
  EXPECT_TRUE(before->frames[0].rounds.empty());
  EXPECT_EQ(before->progress.sample_count_done, 16u * 256u);
  store_->Open();
  const absl::Time deadline = absl::Now() + absl::Seconds(200);
  uint64_t seen = 0;
  while (farm_->view().FindJob(job)->frames[0].rounds.empty() && absl::Now() < deadline) {
    seen = farm_->view().WaitForChange(seen, absl::Seconds(1));
  }
  const auto after = farm_->view().FindJob(job);
  ASSERT_EQ(after->frames[0].rounds.size(), 1u);
  EXPECT_GT(after->progress.sample_count_total, 16u * 256u);
}

// A rate is all samples over the time that they took, also after a restart.
TEST_F(FarmTest, RefinedJobTimeCoversAllSamples) {
  store_->Open();
  const uint64_t id = MakeJob({});
  const std::string job = absl::StrCat(id);
  const absl::Time deadline = absl::Now() + absl::Seconds(600);
  const auto finish = [&](absl::Duration first_work_time) {
    Work(first_work_time);
    const auto view = [&] { return *farm_->view().FindJob(job); };
    while (view().state != JobState::kSucceeded && absl::Now() < deadline) {
      Work(absl::Milliseconds(2));  // The farm needs its lock as well.
    }
    EXPECT_EQ(view().state, JobState::kSucceeded);
    EXPECT_GE(view().progress.wall_seconds, view().frames[0].progress.wall_seconds);
    return view().progress.wall_seconds;
  };
  const double before = finish(absl::Milliseconds(300));
  EXPECT_GE(before, 0.3);
  ASSERT_TRUE(farm_->RefineJob(id, {.refinement = {{}, 512}}).ok());
  EXPECT_GE(farm_->view().FindJob(job)->progress.wall_seconds, before);
  const double after = finish(absl::Milliseconds(100));
  EXPECT_GE(after, before + 0.1);
  Start();
  store_->Open();
  EXPECT_NEAR(farm_->view().FindJob(job)->progress.wall_seconds, after, 1e-6);
  ASSERT_TRUE(farm_->RefineJob(id, {.refinement = {{}, 1024}}).ok());
  EXPECT_GE(finish(absl::ZeroDuration()), after);
}

// The time left is told by the cost of the job's samples, and by other jobs' work until then.
TEST_F(FarmTest, RemainingTimeCountsOtherJobs) {
  store_->Open();
  const uint64_t id = MakeJob({});
  const std::string job = absl::StrCat(id);
  const absl::Time deadline = absl::Now() + absl::Seconds(600);
  // One worker with one thread.
  const auto expected = [&](double pixel_samples) {
    return pixel_samples * absl::ToDoubleSeconds(kSampleCpu) / kUsualThreadUse;
  };
  const auto progress = [&] { return farm_->view().FindJob(job)->progress; };
  while (farm_->view().FindJob(job)->state != JobState::kSucceeded && absl::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  ASSERT_TRUE(farm_->RefineJob(id, {.refinement = {{}, uint64_t{1} << 20}}).ok());
  Work();
  const ProgressView alone = progress();
  const auto left = static_cast<double>(alone.sample_count_total - alone.sample_count_done);
  ASSERT_GT(left, 0);
  EXPECT_NEAR(*alone.remaining_seconds, expected(left), 0.01 * expected(left));
  EXPECT_NEAR(*farm_->view().FindJob(job)->frames[0].progress.remaining_seconds,
              *alone.remaining_seconds, 1e-9);
  // Another job that is smaller gets all of its samples meanwhile.
  const uint64_t other = MakeJob({}, uint64_t{1} << 19);
  const double both = expected(left + 16 * 16 * (1 << 19));
  while (progress().remaining_seconds < 0.99 * both && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  EXPECT_NEAR(*progress().remaining_seconds, both, 0.01 * both);
  ASSERT_TRUE(farm_->SetJobPriority(other, {.priority = -1}).ok());
  while (progress().remaining_seconds > 0.99 * both && absl::Now() < deadline) {
    absl::SleepFor(absl::Milliseconds(10));
  }
  EXPECT_NEAR(*progress().remaining_seconds, *alone.remaining_seconds, 1e-9);
}

// A frame without a rule has a point at each doubling that is seen, and one at its end.
// A byte changes in the log of the database after a kill, and its last changes are lost with it,
// the frame's delivery among them: the farm tells of that, and makes the same image again.
TEST_F(FarmTest, ADeliveryThatIsLostIsMadeAgain) {
  StartWithoutThread();
  store_->Open();
  const uint64_t id = MakeJob({});
  Finish(id);
  const auto image = [&] { return ReadWholeFile(*store_->OutputPath({id, 1}), 1 << 24).value(); };
  const std::string delivered = image();
  const std::string killed = directory_ + "-killed";
  std::filesystem::remove_all(killed);
  std::filesystem::copy(directory_, killed, std::filesystem::copy_options::recursive);
  farm_.reset();
  std::filesystem::remove_all(directory_);
  std::filesystem::rename(killed, directory_);
  const std::string log_path = directory_ + "/farm.db-wal";
  std::filesystem::remove(directory_ + "/farm.db-shm");
  std::fstream log(log_path, std::ios::in | std::ios::out | std::ios::binary);
  constexpr int64_t kHeaderBytes = 32, kFrameBytes = 24 + 4096;
  const auto log_bytes = static_cast<int64_t>(std::filesystem::file_size(log_path));
  log.seekp(kHeaderBytes + (log_bytes - kHeaderBytes) / kFrameBytes / 2 * kFrameBytes + 1000);
  log.put('\x5a');
  log.close();

  StartWithoutThread();
  store_->Open();
  EXPECT_NE(farm_->view().FindJob(absl::StrCat(id))->state, JobState::kSucceeded);
  EXPECT_FALSE(farm_->view().FindJob(absl::StrCat(id))->frames[0].complete);
  {
    const MutexLock lock(&farm_->tables().mutex);
    EXPECT_GT(farm_->tables().scheduler.counters().commits_lost, 1u);
    EXPECT_GT(farm_->tables().scheduler.counters().parts_unrecorded, 0u);
  }
  Finish(id);
  EXPECT_EQ(image(), delivered);
}

TEST_F(FarmTest, FramesWithoutAStopRuleHaveACurve) {
  store_->Open();
  const std::string job = absl::StrCat(MakeJob({}));
  const absl::Time deadline = absl::Now() + absl::Seconds(600);
  const auto rounds = [&] { return farm_->view().FindJob(job)->frames[0].rounds; };
  Work();
  while (rounds().empty() && absl::Now() < deadline) absl::SleepFor(absl::Milliseconds(10));
  ASSERT_EQ(rounds().size(), 1u);
  EXPECT_EQ(rounds()[0].sample_count, 16u * 256u);
  EXPECT_GT(rounds()[0].relative_mse, 0);
  EXPECT_GT(rounds()[0].relative_mse_upper, rounds()[0].relative_mse);
  EXPECT_GT(rounds()[0].part_bytes, 0u);
  while (!farm_->view().FindJob(job)->frames[0].complete && absl::Now() < deadline) Work();
  const std::vector<RoundView> curve = rounds();
  ASSERT_GE(curve.size(), 2u);
  EXPECT_LE(curve.size(), 5u);  // 16, 32, 64, 128 and 256 samples.
  EXPECT_EQ(curve.back().sample_count, 256u * 256u);
  const double delivered = *farm_->view().FindJob(job)->frames[0].progress.relative_mse;
  EXPECT_NEAR(curve.back().relative_mse, delivered, 1e-6 * delivered);
  farm_->signals().WaitForEnd(0, absl::Seconds(60));
  EXPECT_EQ(farm_->signals().EndCount(), 1u);
  for (size_t i = 1; i < curve.size(); ++i) {
    EXPECT_GT(curve[i].sample_count, curve[i - 1].sample_count);
  }
  // Its points depend on when a worker asked; neighbors may be as near as their errors.
  EXPECT_LT(curve.back().relative_mse, curve.front().relative_mse);
}

}  // namespace
}  // namespace sheaf::coordinator
